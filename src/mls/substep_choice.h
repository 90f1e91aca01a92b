// How long a substep of the meshless method may be.
#pragma once

#include <cstdint>
#include <vector>

#include "frame/stability_limit.h"
#include "frame/step_acceptance.h"
#include "frame/step_length.h"
#include "mls/state.h"

namespace tissue_sim {

/// StabilityLimit, StepLength and StepAcceptance, with what nodes and their pairs know of cuts. An
/// element is a node. A cut that leaves a node whose own_rate() is more than that of all of its
/// material when the limit was measured, or springs that may be too fast for it, as few cuts do,
/// has the limit measured at once.
class MlsSubsteps {
 public:
  explicit MlsSubsteps(const MlsState& state);
  MlsSubsteps(const MlsSubsteps&) = delete;
  MlsSubsteps& operator=(const MlsSubsteps&) = delete;
  /// The next part of a frame of which `time` is left [s]. `measure` counts all nodes.
  PartSubsteps part(const MlsState& state, double time, const MeasureLimit& measure);
  /// After a part with substeps of `dt` [s], which left each node so stiff and the one that is
  /// stretched most so far (MlsMeasure): whether they were borne. If not, the next ones are
  /// shorter.
  bool is_borne(const MlsState& state, const std::vector<float>& stiffening, float stretch2,
                double dt);
  /// These nodes lost pairs.
  void cut(const MlsState& state, const std::vector<std::int32_t>& nodes);

 private:
  template <class Archive>
  friend void fields(Archive& archive, MlsSubsteps& substeps);

  /// What the fastest viscosity slows nodes by, half that rate [1/s], where the substep `elastic`
  /// is what tissue bears without [s].
  double damping(const MlsState& state, double elastic) const;

  std::vector<Stiffness> stiffness_;  ///< [nodes]
  std::vector<Stiffness*> elements_;  ///< these
  std::vector<float> modulus_;        ///< [nodes] after the last part [Pa]
  double stretched_ =
      1;  ///< by how much viscosity grew of the node where most, after the last part
  /// Largest own_rate() of each material's nodes when the limit was measured [1/s^2].
  std::vector<double> most_rate_;
  StabilityLimit limit_;
  StepLength length_;
  StepAcceptance acceptance_;
};

}  // namespace tissue_sim
