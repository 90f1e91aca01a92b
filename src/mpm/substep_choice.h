// How long a substep may be: what any tissue bears, and what this one was measured to bear.
#pragma once

#include <vector>

#include "compute/host_device.h"
#include "frame/stability_limit.h"
#include "frame/step_acceptance.h"
#include "frame/step_length.h"
#include "mpm/mpm_state.h"
#include "mpm/state_figures.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

/// The cautious substep, stable_substep(), is what a lone point bears that was cut off on all
/// sides; whole tissue bears about twice as much. So the limit is measured, substeps are chosen by
/// it, and a part of a frame that went beyond it is rejected: StabilityLimit, StepLength,
/// StepAcceptance, here with what the lattice knows of cuts, tears and tools.
class SubstepChoice {
 public:
  /// Whether tissue that ended a part of a frame with these moduli (see follow()) and this
  /// stable_substep() could bear the part's substeps of `dt` [s], and has no energy from nowhere.
  /// If not, the next ones are shorter: until one is borne, or they cannot be the reason.
  bool is_borne(const MpmState& state, const std::vector<float>& modulus, double cautious,
                double dt, const PartEnergy& energy);
  /// Whether the energy must be measured at the ends of the next part, for stiffness alone may not
  /// tell how tissue fares: where it is strained, or in debris, whose light nodes rattle about.
  static bool is_watched(const MpmState& state);
  StepAcceptance& acceptance() { return acceptance_; }
  /// After a part of a frame: `modulus` is of each block the largest P-wave modulus of its points,
  /// as they are deformed [Pa].
  void follow(MpmState& state, const std::vector<float>& modulus);

  /// The longest substep for the next part of a frame with this input that is stable with a margin
  /// [s]: at least stable_substep(), and not more where something is cut before the first substep,
  /// or just tore.
  double longest(MpmState& state, const FrameInput& input, const FrameColliders& colliders,
                 const Stiffening& stiffening, const MeasureLimit& measure);

  /// The next part of a frame with this input of which `time` is left [s], after longest() said
  /// `longest`: all of it, unless something stiffened fast, was cut, or is pushed by a fast tool.
  PartSubsteps part(const MpmState& state, const FrameInput& input, const FrameColliders& colliders,
                    double time, double longest) const;

  TISSUE_SIM_FIELDS(limit_, length_, acceptance_)

 private:
  /// longest() as long as no part was rejected.
  double longest_predicted(MpmState& state, const FrameInput& input,
                           const FrameColliders& colliders, const Stiffening& stiffening,
                           double cautious, const MeasureLimit& measure);

  StabilityLimit limit_;
  StepLength length_;
  StepAcceptance acceptance_;
};

}  // namespace tissue_sim
