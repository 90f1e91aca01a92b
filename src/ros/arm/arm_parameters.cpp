#include "ros/arm/arm_parameters.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include "ros/pose_track.h"
#include "ros/xmlrpc_yaml.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

using XmlRpc::XmlRpcValue;

[[noreturn]] void refuse(const std::string& name, XmlRpcValue& value, const std::string& allowed) {
  throw std::invalid_argument("~" + name + " is " + yaml_from(value) + ": " + allowed);
}

bool number_of(XmlRpcValue& v, double& number) {
  if (v.getType() == XmlRpcValue::TypeInt) {
    number = static_cast<int&>(v);
  } else if (v.getType() == XmlRpcValue::TypeDouble) {
    number = static_cast<double&>(v);
  } else {
    return false;
  }
  return std::isfinite(number);
}

void read(const ros::NodeHandle& node, const std::string& name, double& value, double min,
          double max) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (!number_of(v, value) || value < min || value > max) {
    refuse(name, v, "must be a number from " + std::to_string(min) + " to " + std::to_string(max));
  }
}

// A list of as many numbers as `value` has; a launch file's text is read as YAML by rosparam.
template <class Vector>
void read(const ros::NodeHandle& node, const std::string& name, Vector& value) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  const int size = static_cast<int>(value.size());
  const std::string allowed = "must be a list of " + std::to_string(size) + " numbers";
  if (v.getType() != XmlRpcValue::TypeArray || v.size() != size) refuse(name, v, allowed);
  for (int i = 0; i < size; ++i) {
    if (!number_of(v[i], value[i])) refuse(name, v, allowed);
  }
}

void read(const ros::NodeHandle& node, const std::string& name, std::string& value) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (v.getType() != XmlRpcValue::TypeString) refuse(name, v, "must be text");
  value = static_cast<std::string&>(v);
}

void read(const ros::NodeHandle& node, const std::string& name, bool& value) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (v.getType() != XmlRpcValue::TypeBoolean) refuse(name, v, "must be true or false");
  value = static_cast<bool&>(v);
}

}  // namespace

ArmParameters read_arm_parameters(const ros::NodeHandle& own, const std::string& name) {
  ArmParameters p;
  p.base_frame = name + "_base";
  p.tip_frame = name;
  p.start << 0, 0, 0.12, 0, 0, 0;
  p.mount_angle = 0.5 * M_PI;  // jaws open about the wrist's yaw axis
  read(own, "rate", p.rate, 1, 2000);
  read(own, "simulator", p.simulator);
  read(own, "tool", p.tool);
  read(own, "world_frame", p.world_frame);
  read(own, "base_frame", p.base_frame);
  read(own, "tip_frame", p.tip_frame);
  read(own, "mount_angle", p.mount_angle, -2 * M_PI, 2 * M_PI);
  read(own, "enabled", p.enabled);
  read(own, "homed", p.homed);
  read(own, "geometry/wrist_offset", p.geometry.wrist_offset, -0.5, 0.5);
  read(own, "geometry/pitch_to_yaw", p.geometry.pitch_to_yaw, 0, 0.1);
  read(own, "geometry/yaw_to_tip", p.geometry.yaw_to_tip, 0, 0.2);
  read(own, "base_position", p.base.position);
  std::vector<double> turn = {0, 0, 0, 1};
  read(own, "base_orientation", turn);
  p.base.orientation = Quat(turn[3], turn[0], turn[1], turn[2]);
  const std::string wrong = problem_of(p.base, kRounding);
  if (!wrong.empty()) throw std::invalid_argument("~base_orientation " + wrong);
  p.base.orientation.normalize();
  read(own, "start", p.start);
  const std::string outside = outside_limits(arm_limits().data(), p.start);
  if (!outside.empty()) throw std::invalid_argument("~start: " + outside);
  const JointLimits jaw = jaw_limits();
  read(own, "start_jaw", p.start_jaw, jaw.lower, jaw.upper);
  if (p.tool.empty()) {
    throw std::invalid_argument("~tool is not set: give a tool of the simulator's scene");
  }
  return p;
}

}  // namespace tissue_sim
