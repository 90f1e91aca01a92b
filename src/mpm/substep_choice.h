// How long a substep may be: what any tissue bears, and what this one was measured to bear.
#pragma once

#include <functional>
#include <vector>

#include "mpm/mpm_state.h"
#include "mpm/state_figures.h"

namespace tissue_sim {

/// Measures the limit of stability of the linearised motion [s]: of the blocks of the state whose
/// flag is set, with `steps` steps of largest_eigenvalue().
using MeasureLimit = std::function<double(const std::vector<std::uint8_t>& blocks, int steps)>;

/// The cautious substep, stable_substep(), is what a lone point bears that was cut off on all
/// sides; whole tissue bears about twice as much. So the highest frequency is measured now and
/// then, and where a cut went at once; in between the stiffening of each block bounds how it grew.
class SubstepChoice {
 public:
  /// After a frame: `modulus` is of each block the largest P-wave modulus of its points, as they
  /// are deformed [Pa].
  void follow(MpmState& state, const std::vector<float>& modulus);

  /// The longest substep for a frame with this input that is stable with a margin [s]: at least
  /// stable_substep(), and not more where something is cut before the first substep, or just tore.
  double longest(MpmState& state, const FrameInput& input, const Stiffening& stiffening,
                 const MeasureLimit& measure);

 private:
  void measure_if_due(MpmState& state, const MeasureLimit& measure);

  double limit_ = 0;   ///< when it was measured last [s]; 0 where it is not known
  double growth_ = 1;  ///< of the stiffness since, at most
  double trend_ = 1;   ///< of the stiffness in the last frame, at most
  int age_ = 0;        ///< frames since all blocks were measured
};

}  // namespace tissue_sim
