#include "ros/jaw_check.h"

#include <cmath>
#include <cstdio>

namespace tissue_sim {

JawAngle jaw_angle(const sensor_msgs::JointState& message) {
  JawAngle jaw;
  if (message.position.empty()) {
    jaw.problem = "the message has no position";
    return jaw;
  }
  if (message.position.size() > kMostJoints || message.name.size() > kMostJoints) {
    jaw.problem = "the message has more than " + std::to_string(kMostJoints) + " joints";
    return jaw;
  }
  const std::size_t joints = message.position.size(), names = message.name.size();
  const std::string count = "the message has " + std::to_string(joints) + " joints";
  if (names > 0 && names != joints) {
    jaw.problem = count + " and names of " + std::to_string(names);
    return jaw;
  }
  std::size_t joint = 0, called = 0;
  for (std::size_t i = 0; i < names; ++i) {
    if (message.name[i].find("jaw") != std::string::npos) joint = i, ++called;
  }
  if (joints > 1 && called != 1) {
    jaw.problem = count +
                  (names == 0    ? " without names"
                   : called == 0 ? ", none of them called 'jaw'"
                                 : ", several of them called 'jaw'") +
                  ": which is the angle between the jaws is not said; send that one alone, or "
                  "with 'jaw' in its name and in no other";
    return jaw;
  }
  jaw.angle = message.position[joint];
  char text[160];
  if (!std::isfinite(jaw.angle)) {
    jaw.problem = "not finite";
  } else if (std::fabs(jaw.angle) > 1.001 * M_PI) {  // rounded by hand
    const bool degrees = std::fabs(jaw.angle) <= 360;
    std::snprintf(text, sizeof text, "%g rad is no angle between jaws (at most pi)", jaw.angle);
    jaw.problem = text;
    if (degrees) {
      std::snprintf(text, sizeof text, ": is it in degrees? These are %.4g rad",
                    jaw.angle * M_PI / 180);
      jaw.problem += text;
    }
  }
  return jaw;
}

}  // namespace tissue_sim
