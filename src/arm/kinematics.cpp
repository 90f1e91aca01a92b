#include "arm/kinematics.h"

#include <cmath>
#include <cstdio>
#include <limits>

namespace tissue_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSlack = 1e-6;  // of limits: what is said in degrees is rounded

using Mat3 = Eigen::Matrix3d;

Mat3 about_minus_x(double angle) { return Eigen::AngleAxisd(-angle, Vec3::UnitX()).matrix(); }
Mat3 about_minus_y(double angle) { return Eigen::AngleAxisd(-angle, Vec3::UnitY()).matrix(); }
Mat3 about_minus_z(double angle) { return Eigen::AngleAxisd(-angle, Vec3::UnitZ()).matrix(); }

// The tip's axes in those of the last joint.
Mat3 tip_axes() {
  Mat3 m;
  m << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  return m;
}

// Where all axes stand.
struct Chain {
  Mat3 after_yaw, after_pitch, after_roll, after_wrist_pitch, after_wrist_yaw;
  Vec3 wrist_pitch, wrist_yaw, tip;
};

Chain chain_of(const ArmGeometry& geometry, const Joints& q) {
  Chain c;
  c.after_yaw = about_minus_y(q[0]);
  c.after_pitch = c.after_yaw * about_minus_x(q[1]);
  c.after_roll = c.after_pitch * about_minus_z(q[3]);
  c.after_wrist_pitch = c.after_roll * about_minus_x(q[4]);
  c.after_wrist_yaw = c.after_wrist_pitch * about_minus_y(q[5]);
  c.wrist_pitch = -(q[2] + geometry.wrist_offset) * c.after_pitch.col(2);
  c.wrist_yaw = c.wrist_pitch - geometry.pitch_to_yaw * c.after_wrist_pitch.col(2);
  c.tip = c.wrist_yaw - geometry.yaw_to_tip * c.after_wrist_yaw.col(2);
  return c;
}

double excess(const JointLimits& limits, double q) {
  return std::max({limits.lower - q, q - limits.upper, 0.0});
}

}  // namespace

std::array<JointLimits, kArmJoints> arm_limits() {
  return {{{"outer_yaw", -1.605, 1.605, 1, 4},
           {"outer_pitch", -0.9346, 0.9346, 1, 4},
           {"outer_insertion", 0, 0.24, 0.1, 0.4},
           {"outer_roll", -3.0456, 3.0456, 2, 8},
           {"outer_wrist_pitch", -80 * kPi / 180, 80 * kPi / 180, 2, 8},
           {"outer_wrist_yaw", -80 * kPi / 180, 80 * kPi / 180, 2, 8}}};
}

JointLimits jaw_limits() { return {"jaw", -20 * kPi / 180, 80 * kPi / 180, 2, 8}; }

Pose forward_kinematics(const ArmGeometry& geometry, const Joints& joints) {
  const Chain c = chain_of(geometry, joints);
  return {c.tip, Quat(c.after_wrist_yaw * tip_axes())};
}

Jacobian jacobian(const ArmGeometry& geometry, const Joints& joints) {
  const Chain c = chain_of(geometry, joints);
  const Vec3 shaft = -c.after_pitch.col(2);
  Jacobian j = Jacobian::Zero();
  const auto turn = [&](int column, const Vec3& axis, const Vec3& through) {
    j.col(column).head<3>() = axis.cross(c.tip - through);
    j.col(column).tail<3>() = axis;
  };
  turn(0, -Vec3::UnitY(), Vec3::Zero());
  turn(1, -c.after_yaw.col(0), Vec3::Zero());
  j.col(2).head<3>() = shaft;
  turn(3, shaft, Vec3::Zero());
  turn(4, -c.after_roll.col(0), c.wrist_pitch);
  turn(5, -c.after_wrist_pitch.col(1), c.wrist_yaw);
  return j;
}

Jacobian in_axes(const Jacobian& base, const Quat& orientation) {
  const Mat3 back = orientation.matrix().transpose();
  Jacobian j;
  j.topRows<3>() = back * base.topRows<3>();
  j.bottomRows<3>() = back * base.bottomRows<3>();
  return j;
}

InverseKinematics inverse_kinematics(const ArmGeometry& geometry,
                                     const std::array<JointLimits, kArmJoints>& limits,
                                     const Pose& tip, const Joints& seed) {
  InverseKinematics best;
  best.why = "the wrist's yaw axis would point through the remote centre";
  const Mat3 last = tip.orientation.matrix() * tip_axes().transpose();
  const Vec3 yaw_axis = -last.col(1), ahead = -last.col(2);
  const Vec3 wrist_yaw = tip.position - geometry.yaw_to_tip * ahead;
  // The wrist's pitch axis is normal to its yaw axis and to the shaft, which passes through the
  // remote centre: so that centre, the shaft and the link between the two axes lie in one plane.
  const Vec3 across = wrist_yaw - wrist_yaw.dot(yaw_axis) * yaw_axis;
  if (!(across.norm() > 1e-9)) return best;
  double nearest = std::numeric_limits<double>::infinity(), least = nearest;
  for (const double side : {1.0, -1.0}) {
    const Vec3 link = side * across.normalized();
    const Vec3 wrist_pitch = wrist_yaw - geometry.pitch_to_yaw * link;
    const double reach = wrist_pitch.norm();
    if (!(reach > 1e-9)) continue;
    for (const double sign : {1.0, -1.0}) {
      const Vec3 shaft = sign / reach * wrist_pitch;
      Joints q;
      q[1] = -std::asin(std::min(1.0, std::max(-1.0, shaft.y())));
      q[0] = std::atan2(shaft.x(), -shaft.z());
      q[2] = sign * reach - geometry.wrist_offset;
      const Mat3 after_pitch = about_minus_y(q[0]) * about_minus_x(q[1]);
      const Vec3 axis = after_pitch.transpose() * link.cross(yaw_axis);
      q[3] = std::atan2(axis.y(), -axis.x());
      const Mat3 after_roll = after_pitch * about_minus_z(q[3]);
      const Vec3 bent = after_roll.transpose() * link;
      q[4] = std::atan2(-bent.y(), -bent.z());
      const Vec3 turned = (after_roll * about_minus_x(q[4])).transpose() * ahead;
      q[5] = std::atan2(turned.x(), -turned.z());
      for (const double turn : {0.0, 2 * kPi, -2 * kPi}) {
        Joints way = q;
        way[3] += turn;
        double worst = 0;
        int which = -1;
        for (int i = 0; i < kArmJoints; ++i) {
          const double beyond = excess(limits[i], way[i]);
          if (beyond > worst) worst = beyond, which = i;
        }
        if (worst <= kSlack) {
          const double distance = (way - seed).squaredNorm();
          if (distance >= nearest) continue;
          nearest = distance;
          best = {true, way, ""};
        } else if (!best.found && worst < least) {
          least = worst;
          best.joints = way;
          char text[160];
          std::snprintf(text, sizeof text, "%s would be at %.4g, it goes from %.4g to %.4g",
                        limits[which].name.c_str(), way[which], limits[which].lower,
                        limits[which].upper);
          best.why = text;
        }
      }
    }
  }
  return best;
}

std::string outside_limits(const JointLimits* limits, const JointVector& joints) {
  for (int i = 0; i < joints.size(); ++i) {
    char text[160];
    if (!std::isfinite(joints[i])) return limits[i].name + " is not finite";
    if (excess(limits[i], joints[i]) <= kSlack) continue;
    std::snprintf(text, sizeof text, "%s is %.4g, it goes from %.4g to %.4g",
                  limits[i].name.c_str(), joints[i], limits[i].lower, limits[i].upper);
    return text;
  }
  return "";
}

}  // namespace tissue_sim
