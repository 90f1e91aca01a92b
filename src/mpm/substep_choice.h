// How long a substep may be: what any tissue bears, and what this one was measured to bear.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "frame/part_substeps.h"
#include "mpm/mpm_state.h"
#include "mpm/state_figures.h"

namespace tissue_sim {

/// Measures the limit of stability of the linearised motion [s]: of the blocks of the state whose
/// flag is set, with `steps` steps of largest_eigenvalue().
using MeasureLimit = std::function<double(const std::vector<std::uint8_t>& blocks, int steps)>;

/// What a part of a frame left and brought [J].
struct PartEnergy {
  double kinetic = NAN, elastic = NAN;  ///< at its end; NAN where they were not measured
  double given = 0;                     ///< by instruments
  double time = 0;                      ///< that it took [s]
};

/// The cautious substep, stable_substep(), is what a lone point bears that was cut off on all
/// sides; whole tissue bears about twice as much. So the highest frequency is measured now and
/// then, and where a cut went at once; in between the stiffening of each block bounds how it grew.
///
/// None of this knows what a part of a frame brings: a few points that swing may stiffen tenfold
/// within six substeps. So a part that stiffened until its substeps were too long is undone, and
/// done again with shorter ones.
class SubstepChoice {
 public:
  /// Whether tissue that ended a part of a frame with these moduli (see follow()) and this
  /// stable_substep() could bear the part's substeps of `dt` [s], and has no energy from nowhere.
  /// If not, the next ones are shorter: until one is borne, or they cannot be the reason.
  bool is_borne(const MpmState& state, const std::vector<float>& modulus, double cautious,
                double dt, const PartEnergy& energy);
  /// Whether tissue is so strained that stiffness alone may not tell how it fares: then substeps
  /// keep a wider margin, and the energy must be measured at the end of the next part.
  static bool is_strained(const MpmState& state);
  /// After a part of a frame: `modulus` is of each block the largest P-wave modulus of its points,
  /// as they are deformed [Pa].
  void follow(MpmState& state, const std::vector<float>& modulus);

  /// The longest substep for the next part of a frame with this input that is stable with a margin
  /// [s]: at least stable_substep(), and not more where something is cut before the first substep,
  /// or just tore.
  double longest(MpmState& state, const FrameInput& input, const Stiffening& stiffening,
                 const MeasureLimit& measure);

  /// The next part of a frame with this input of which `time` is left [s], after longest() said
  /// `longest`: all of it, unless something stiffened fast, was cut, or is pushed by a fast tool.
  PartSubsteps part(const MpmState& state, const FrameInput& input, double time,
                    double longest) const;

 private:
  /// longest() as long as no part had to be undone.
  double longest_foreseen(MpmState& state, const FrameInput& input, const Stiffening& stiffening,
                          double cautious, const MeasureLimit& measure);
  /// The same for tissue that nothing damps: it swings for long, and each change of its substeps
  /// would add to its energy. They are as short as the shortest of a swing.
  double held(double time, double foreseen);
  void measure_if_due(MpmState& state, const MeasureLimit& measure);

  double limit_ = 0;        ///< when it was measured last [s]; 0 where it is not known
  double measured_at_ = 0;  ///< when that was of all blocks [s]
  double longest_age_ = 0;  ///< of limit_ [s]
  double growth_ = 1;       ///< of the stiffness since, at most
  double trend_ = 1;        ///< of the stiffness in the last part, at most
  double part_ = 0;         ///< how long the next part may be [s], ...
  double most_ = 0;  ///< ... and its first substep, until they are as short as they should be
  double held_ = INFINITY;                                                 ///< see held() [s]
  double of_swing_ = INFINITY, of_last_swing_ = INFINITY, swing_end_ = 0;  ///< the same
  double followed_at_ = 0;                                                 ///< [s]
  double energy_ = NAN;   ///< after the last part that was borne [J]
  double shortened_ = 1;  ///< how much substeps are shorter than they would be, after parts that
                          ///< were not borne
};

}  // namespace tissue_sim
