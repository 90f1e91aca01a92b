// How far the jaws of a grasper close.
#pragma once

#include "tissue_sim/tool.h"

namespace tissue_sim {

/// Jaws asked to close further than closed squeeze: what they press with at most grows in
/// proportion to the angle below 0, to kMostSqueeze times as much at -kFullSqueeze (20 degrees, as
/// far as a dVRK's jaws may be asked to go) and beyond.
constexpr double kMostSqueeze = 3;
constexpr double kFullSqueeze = 0.35;  ///< [rad]

/// What jaws that are asked for the angle `jaw` [rad] press with at most, where it is `pressure` at
/// angles from 0 on [Pa].
double squeezed(double pressure, double jaw);

/// Jaws follow the angle that is asked for, but press with no more than a given pressure: what
/// an instrument's motor does, frame by frame. The next frame depends on what they pressed with
/// before alone, so the same inputs bring the same jaws, also where they were limited already.
class Grip {
 public:
  /// Limits the motion's jaws in the next frame, of `duration` seconds, to what presses with about
  /// `pressure` [Pa] at most.
  void limit(double pressure, double duration, ToolMotion& motion) const;
  /// What the jaws pressed with in that frame [Pa], mean.
  void follow(const ToolMotion& motion, double pressed);

 private:
  template <class Archive>
  friend void fields(Archive& archive, Grip& grip);  // frame/state_fields.h

  double pressed_ = 0;    // [Pa]
  double stiffness_ = 0;  // growth of the pressure with the angle [Pa/rad]
};

}  // namespace tissue_sim
