// How long a substep of the meshless method may be.
#pragma once

#include <cstdint>
#include <vector>

#include "frame/part_substeps.h"
#include "mls/linearised_motion.h"
#include "mls/state.h"

namespace tissue_sim {

/// The limit of stability is measured (Lanczos' method) when a node stiffened by a third, and every
/// half second, or tenth while something is cut; at once where a cut leaves a node whose own_rate()
/// is more than that of all when it was measured, as few cuts do. In between the largest growth of
/// any node's modulus shortens the substep. A part of a frame that stiffened until its substeps
/// were too long is undone and done again with shorter ones.
class MlsSubsteps {
 public:
  /// Whether measure() is due before the next part.
  bool is_due(const MlsState& state) const;
  /// Measures the limit.
  void measure(const MlsState& state, const MlsForces& forces);
  /// The next part of a frame of which `time` is left [s].
  PartSubsteps part(const MlsState& state, double time);
  /// After a part: `stiffening` of each node (MlsKernels::measure), whether its substeps of `dt`
  /// were borne. If not, the next ones are shorter.
  bool is_borne(const MlsState& state, const std::vector<float>& stiffening, double dt);
  /// These nodes lost pairs.
  void cut(const MlsState& state, const std::vector<std::int32_t>& nodes);

 private:
  template <class Archive>
  friend void fields(Archive& archive, MlsSubsteps& substeps);

  /// Largest growth of a node's modulus since the limit was measured.
  double growth(const MlsState& state, const std::vector<float>& stiffening) const;

  std::vector<float> measured_;  ///< stiffening of each node when the limit was measured
  std::vector<float> now_;       ///< after the last part
  double limit_ = 0;             ///< [s]; 0: not known
  double measured_at_ = 0;       ///< [s]
  double growth_ = 1;            ///< after the last part
  double trend_ = 1;             ///< growth in the last part
  int count_ = 64;               ///< substeps of a part at most
  double shortened_ = 1;         ///< after parts that were not borne
  bool is_new_ = true;           ///< the limit was not known before it was measured last
  bool was_cut_ = false;         ///< since it was measured
  double most_rate_ = 0;         ///< largest own_rate() of a node when it was measured [1/s^2]
};

/// Largest eigenvalue that the energy of a node's own strain has by itself, or less than three
/// times it: how fast nodes around it swing hangs on that [1/s^2].
double own_rate(const MlsState& state, std::int32_t node);

}  // namespace tissue_sim
