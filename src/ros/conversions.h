// Core types <-> ROS messages.
#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <geometry_msgs/Vector3.h>
#include <geometry_msgs/Wrench.h>
#include <sensor_msgs/PointCloud2.h>

#include "ros/messages.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

Vec3 from_message(const geometry_msgs::Point& p);
Pose from_message(const geometry_msgs::Pose& pose);
Pose from_message(const geometry_msgs::Transform& transform);

geometry_msgs::Point to_point(const Vec3& v);
geometry_msgs::Vector3 to_vector3(const Vec3& v);
geometry_msgs::Quaternion to_quaternion(const Quat& q);
geometry_msgs::Pose to_pose(const Pose& pose);
geometry_msgs::Transform to_transform(const Pose& pose);
geometry_msgs::Wrench to_wrench(const Wrench& wrench);

/// The same wrench in the axes of a tool that is turned by `orientation`.
Wrench in_axes(const Wrench& world, const Quat& orientation);

/// `a` after `b`: x_world = a * (b * x).
Pose operator*(const Pose& a, const Pose& b);

BladeSweep to_message(const BladePath& path);
FrameInputMessage to_message(const AppliedInput& input, const Scene& scene);
/// The way back, for replays; tools in the scene's order.
AppliedInput from_message(const FrameInputMessage& message);

/// Without its header.
JawGrip to_message(const ToolLoad& load, const ToolMotion& motion, double pressure_limit);

TissueFragment to_message(const Fragment& fragment, const Scene& scene);

/// 16 hexadecimal digits: a number above 2^53 would be rounded by all that knows doubles alone.
std::string to_hex(std::uint64_t checksum);
/// Without commas, at which `rostopic echo -p` parts columns: "cpu (AVX-512; 2 threads)".
std::string without_commas(std::string text);

/// What points of a cloud can carry, as parameters and clouds call it.
struct CloudField {
  const char* name;
  PointField flag;
  const char* components[6];
};
inline constexpr CloudField kCloudFields[] = {
    {"rest", kRestPosition, {"rest_x", "rest_y", "rest_z"}},
    {"displacement", kDisplacement, {"ux", "uy", "uz"}},
    {"velocity", kVelocity, {"vx", "vy", "vz"}},
    {"volume", kVolume, {"volume"}},
    {"stress_tensor", kStressTensor, {"sxx", "syy", "szz", "sxy", "syz", "szx"}}};

/// Fields, sizes and flags of a cloud of Point with these PointFields behind it; `cloud.data` is
/// filled already.
void describe_points(int count, unsigned fields, sensor_msgs::PointCloud2& cloud);

}  // namespace tissue_sim
