// A tool of six joints about a remote centre: the patient side manipulator of the da Vinci Research
// Kit, whose names and signs it has. No ROS in this room.
//
// In the base frame, whose origin is the remote centre, with all joints but the insertion at zero
// the shaft points along -z, and:
//
//   joint                  turns about       the tip goes   where
//   0  outer_yaw           -y                to +x          through the remote centre
//   1  outer_pitch         -x                to -y          through the remote centre
//   2  outer_insertion     (along -z)        to -z
//   3  outer_roll          -z                               along the shaft
//   4  outer_wrist_pitch   -x                to -y          at insertion + wrist_offset
//   5  outer_wrist_yaw     -y                to +x          pitch_to_yaw further on
//
// Each axis but the first is carried by those before it. The tip lies yaw_to_tip beyond the wrist's
// yaw axis; its frame has z out of the tip, x along that axis (the other way), so at zero x_tip =
// +y, y_tip = +x, z_tip = -z. Jaws that turn about the wrist's yaw axis open in the tip's y-z
// plane.
#pragma once

#include <array>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

constexpr int kArmJoints = 6;
using Joints = Eigen::Matrix<double, kArmJoints, 1>;  ///< [rad], but the insertion [m]
using Jacobian = Eigen::Matrix<double, 6, kArmJoints>;
using JointVector = Eigen::VectorXd;  ///< of a group of joints: the arm's six, the jaw's one

/// Of a large needle driver, 8 mm.
struct ArmGeometry {
  double wrist_offset = -0.0156;  ///< the wrist's pitch axis, beyond the insertion [m]
  double pitch_to_yaw = 0.0091;   ///< from the wrist's pitch axis to its yaw axis [m], 0 or more
  double yaw_to_tip = 0.0102;     ///< from the wrist's yaw axis to the tip [m]
};

struct JointLimits {
  std::string name;
  double lower = 0, upper = 0;  ///< [rad] or [m]
  double velocity = 1;  ///< of moves [1/s of these]; what is commanded is followed twice as fast
  double acceleration = 4;  ///< of moves [1/s^2]
};

/// Names, ranges and speeds of the six joints of such a manipulator.
std::array<JointLimits, kArmJoints> arm_limits();
/// Of its jaws: -20 degrees (they squeeze) to 80.
JointLimits jaw_limits();

/// The tip in the base frame.
Pose forward_kinematics(const ArmGeometry& geometry, const Joints& joints);

/// Linear [m/s] above angular velocity [rad/s] of the tip for joint velocities, in the base's axes.
Jacobian jacobian(const ArmGeometry& geometry, const Joints& joints);

/// Both halves in other axes: x_base = orientation * x.
Jacobian in_axes(const Jacobian& base, const Quat& orientation);

struct InverseKinematics {
  bool found = false;
  Joints joints = Joints::Zero();
  std::string why;  ///< not found: which joint would be where, and its range
};

/// In closed form: of up to four ways to reach the pose, the one within the limits that is nearest
/// to `seed`, the roll a turn more or less.
InverseKinematics inverse_kinematics(const ArmGeometry& geometry,
                                     const std::array<JointLimits, kArmJoints>& limits,
                                     const Pose& tip, const Joints& seed);

/// "" if all are finite and within the limits (within 1e-6), else which is not.
std::string outside_limits(const JointLimits* limits, const JointVector& joints);

}  // namespace tissue_sim
