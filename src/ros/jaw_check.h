// Which of the jaw angles that come in can be meant.
#pragma once

#include <sensor_msgs/JointState.h>

#include <string>

namespace tissue_sim {

constexpr std::size_t kMostJoints = 1000;  ///< of a message; samples may wait for their frame

struct JawAngle {
  double angle = 0;     ///< [rad], as it came; below 0 squeezes
  std::string problem;  ///< why it cannot be used, with values and the guess; "" for none
};

/// The jaw's angle in a JointState: the position of its only joint or, of several, of the one whose
/// name holds "jaw". Refused: none, several of which no name or more than one says that it is
/// meant, names that are more or fewer than joints, one not finite, and one beyond pi or below -pi,
/// as nobody's jaws are: it is in degrees then.
JawAngle jaw_angle(const sensor_msgs::JointState& message);

}  // namespace tissue_sim
