// Parameters of arm_node.
#pragma once

#include <ros/node_handle.h>

#include <string>

#include "arm/kinematics.h"

namespace tissue_sim {

struct ArmParameters {
  double rate = 200;  ///< of all it publishes [Hz]
  std::string simulator = "/simulator";
  std::string tool;  ///< of the simulator's scene, that it drives
  std::string world_frame = "world";
  std::string base_frame;  ///< of local/*; the arm's name and "_base" if left out
  std::string tip_frame;   ///< of body/*; the arm's name if left out
  Pose base;               ///< the remote centre in the world; its z is up the shaft at zero
  double mount_angle = 0;  ///< of the simulator's tool about the tip's z [rad]
  Joints start;            ///< where the arm begins
  double start_jaw = 0;    ///< [rad]
  bool enabled = true, homed = true;  ///< in which state it begins
  ArmGeometry geometry;
};

/// `name` is the arm's: its namespace. Throws std::invalid_argument with
/// "~<name> is <value>: <what is allowed>".
ArmParameters read_arm_parameters(const ros::NodeHandle& own, const std::string& name);

}  // namespace tissue_sim
