#include "ros/arm/arm_node.h"

#include <ros/callback_queue.h>
#include <std_msgs/Float64MultiArray.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "ros/conversions.h"
#include "ros/stamps.h"

namespace tissue_sim {
namespace {

constexpr double kWrenchAge = 0.5;   // older forces are none [s] of wall time
constexpr double kBehind = 0.005;    // tip from setpoint, that is said [m]
constexpr double kStillAfter = 0.2;  // of wall time without a clock that goes on [s]

double seconds_between(WallTime from, WallTime to) {
  return std::chrono::duration<double>(to - from).count();
}

std_msgs::Float64MultiArray to_message(const Jacobian& j) {
  std_msgs::Float64MultiArray m;
  m.layout.dim.resize(2);
  m.layout.dim[0].label = "rows";
  m.layout.dim[0].size = 6;
  m.layout.dim[0].stride = 6 * kArmJoints;
  m.layout.dim[1].label = "cols";
  m.layout.dim[1].size = m.layout.dim[1].stride = kArmJoints;
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < kArmJoints; ++c) m.data.push_back(j(r, c));
  }
  return m;
}

std::vector<JointLimits> listed() {
  const auto limits = arm_limits();
  return {limits.begin(), limits.end()};
}

}  // namespace

ArmNode::ArmNode(ros::NodeHandle& node, const ArmParameters& parameters)
    : node_(node),
      parameters_(parameters),
      arm_(listed(), parameters.start),
      jaw_({jaw_limits()}, JointVector::Constant(1, parameters.start_jaw)),
      listener_(frames_),
      crtk_(node, {[this](const std::string& word) { on_state_command(word); },
                   [this](const std::vector<double>& joints, bool local, Pose& tip) {
                     return forward(joints, local, tip);
                   },
                   [this](const Pose& tip, const std::vector<double>& seed,
                          std::vector<double>& joints) { return inverse(tip, seed, joints); }}) {
  state_.state = parameters.enabled ? "ENABLED" : "DISABLED";
  state_.homed = parameters.homed;
  shown_still_ = WallClock::now();
  advertise();
  subscribe();
}

void ArmNode::advertise() {
  const auto joints = [&](const char* name) {
    out_[name] = node_.advertise<sensor_msgs::JointState>(name, 10);
  };
  const auto pose = [&](const std::string& name) {
    out_[name] = node_.advertise<geometry_msgs::PoseStamped>(name, 10);
  };
  for (const char* name : {"measured_js", "setpoint_js", "jaw/measured_js", "jaw/setpoint_js"}) {
    joints(name);
  }
  for (const char* name :
       {"measured_cp", "setpoint_cp", "local/measured_cp", "local/setpoint_cp"}) {
    pose(name);
  }
  out_["measured_cv"] = node_.advertise<geometry_msgs::TwistStamped>("measured_cv", 10);
  for (const std::string axes : {"body", "spatial"}) {
    out_[axes + "/measured_cf"] =
        node_.advertise<geometry_msgs::WrenchStamped>(axes + "/measured_cf", 10);
    out_[axes + "/jacobian"] = node_.advertise<std_msgs::Float64MultiArray>(axes + "/jacobian", 10);
  }
  out_["trajectory_j/ratio"] = node_.advertise<std_msgs::Float64>("trajectory_j/ratio", 10, true);
  on_ratio(ratio_);
  const std::string tool = parameters_.simulator + "/" + parameters_.tool;
  out_["tool"] = node_.advertise<geometry_msgs::PoseStamped>(tool + "/measured_cp", 10);
  out_["tool/jaw"] = node_.advertise<sensor_msgs::JointState>(tool + "/jaw/measured_js", 10);

  geometry_msgs::TransformStamped base;
  base.header.frame_id = parameters_.world_frame;
  base.child_frame_id = parameters_.base_frame;
  base.transform = to_transform(parameters_.base);
  base_broadcaster_.sendTransform(base);
}

void ArmNode::run() {
  const double period = 1 / parameters_.rate;
  const WallTime began = WallClock::now();
  while (ros::ok()) {
    ros::Time now = ros::Time::now();
    const double left = last_.isZero() ? 0 : period - seconds_between(last_, now);
    ros::getGlobalCallbackQueue()->callAvailable(
        ros::WallDuration(std::min(std::max(left, 0.0005), 0.005)));
    now = ros::Time::now();
    const WallTime wall = WallClock::now();
    if (now < last_) {
      ROS_WARN("time went back by %.3f s: stamps begin anew", seconds_between(now, last_));
      last_ = last_state_ = last_wrench_ = last_body_wrench_ = now;
    }
    if (!now.isZero() && seconds_between(last_, now) >= 0.98 * period) {
      // After a long pause it goes on where it was.
      tick(now, last_.isZero() ? period : std::min(seconds_between(last_, now), 1.0));
      last_ = now;
      shown_still_ = wall;
    } else if (seconds_between(shown_still_, wall) > kStillAfter) {
      if (now.isZero() && seconds_between(began, wall) > 3) {
        WARN_SELDOM(10, "/use_sim_time is set and /clock has not come: the arm stands still");
      }
      publish(now, false);
      shown_still_ = wall;
    }
  }
}

void ArmNode::tick(const ros::Time& now, double seconds) {
  const bool was_busy = busy();
  step_by_twist(now, seconds);
  arm_.advance(seconds, ratio_);
  jaw_.advance(seconds, ratio_);
  publish(now, true);
  drive_tool(now);
  say_if_behind();
  if (!wrench_known_ || seconds_between(wrench_came_, WallClock::now()) > kWrenchAge) {
    wrench_ = {};
    if (ticks_ % 10 == 0) {
      publish_wrench(ros::Time(), wrench_, true);
      publish_wrench(ros::Time(), wrench_, false);
    }
  }
  // Busy on each tick: one edge may be missed. Idle a tick after it has arrived, so that who waited
  // finds it there. At rest now and then, for those who wait for any.
  ++ticks_;
  if (was_busy || busy() || published_busy_ || state_.state != published_state_ ||
      ticks_ % std::max(1, static_cast<int>(parameters_.rate / 5)) == 0) {
    publish_state(was_busy || busy());
  }
}

void ArmNode::publish(const ros::Time& now, bool goes_on) {
  const bool measured = goes_on && state_.homed;
  const bool asked = measured && (state_.state == "ENABLED" || state_.state == "PAUSED");
  const auto stamp = [&](bool valid) { return valid ? now : ros::Time(); };
  publish_joints("measured_js", stamp(measured), arm_, false);
  publish_joints("setpoint_js", stamp(asked), arm_, true);
  publish_joints("jaw/measured_js", stamp(measured), jaw_, false);
  publish_joints("jaw/setpoint_js", stamp(asked), jaw_, true);
  const ros::Time at = stamp(measured && tool_present_), asked_at = stamp(asked && tool_present_);
  const Pose tip = forward_kinematics(parameters_.geometry, arm_.measured());
  const Pose goal = forward_kinematics(parameters_.geometry, arm_.setpoint());
  publish_pose("local/measured_cp", at, parameters_.base_frame, tip);
  publish_pose("local/setpoint_cp", asked_at, parameters_.base_frame, goal);
  publish_pose("measured_cp", at, parameters_.world_frame, parameters_.base * tip);
  if (!at.isZero()) {
    geometry_msgs::TransformStamped frame;
    frame.header.stamp = at;
    frame.header.frame_id = parameters_.world_frame;
    frame.child_frame_id = parameters_.tip_frame;
    frame.transform = to_transform(parameters_.base * tip);
    tip_broadcaster_.sendTransform(frame);
  }
  publish_pose("setpoint_cp", asked_at, parameters_.world_frame, parameters_.base * goal);

  const Jacobian j = jacobian(parameters_.geometry, arm_.measured());
  const Jacobian spatial = in_axes(j, parameters_.base.orientation.inverse());
  const Eigen::Matrix<double, 6, 1> speed = spatial * arm_.measured_velocity();
  geometry_msgs::TwistStamped twist;
  twist.header.stamp = at;
  twist.header.frame_id = parameters_.world_frame;
  twist.twist.linear = to_vector3(speed.head<3>());
  twist.twist.angular = to_vector3(speed.tail<3>());
  out_["measured_cv"].publish(twist);
  out_["spatial/jacobian"].publish(to_message(spatial));
  out_["body/jacobian"].publish(to_message(in_axes(j, tip.orientation)));
}

void ArmNode::publish_joints(const std::string& name, const ros::Time& stamp,
                             const JointGroup& group, bool setpoint) {
  sensor_msgs::JointState m;
  m.header.stamp = stamp;
  const JointVector& q = setpoint ? group.setpoint() : group.measured();
  const JointVector& v = setpoint ? group.setpoint_velocity() : group.measured_velocity();
  for (const JointLimits& joint : group.limits()) m.name.push_back(joint.name);
  m.position.assign(q.data(), q.data() + q.size());
  m.velocity.assign(v.data(), v.data() + v.size());
  m.effort.assign(q.size(), 0.0);
  if (!setpoint && &group == &arm_) {  // what the tissue loads the joints with
    const Jacobian j = in_axes(jacobian(parameters_.geometry, arm_.measured()),
                               parameters_.base.orientation.inverse());
    Eigen::Matrix<double, 6, 1> load;
    load << wrench_.force, wrench_.torque;
    const Joints effort = j.transpose() * load;
    m.effort.assign(effort.data(), effort.data() + kArmJoints);
  }
  if (!setpoint && &group == &jaw_ && grip_known_ &&
      seconds_between(grip_came_, WallClock::now()) < kWrenchAge) {
    m.position[0] = grip_angle_;  // jaws that hold tissue do not close
    m.effort[0] = grip_moment_;
  }
  out_[name].publish(m);
}

void ArmNode::publish_pose(const std::string& name, const ros::Time& stamp,
                           const std::string& frame, const Pose& pose) {
  geometry_msgs::PoseStamped m;
  m.header.stamp = stamp;
  m.header.frame_id = frame;
  m.pose = to_pose(pose);
  out_[name].publish(m);
}

Pose ArmNode::tip_in_world(const JointVector& joints) const {
  return parameters_.base * forward_kinematics(parameters_.geometry, joints);
}

void ArmNode::drive_tool(const ros::Time& now) {
  if (!tool_present_) return;
  Pose tool = tip_in_world(arm_.measured());
  tool.orientation =
      tool.orientation * Quat(Eigen::AngleAxisd(parameters_.mount_angle, Vec3::UnitZ()));
  sensor_msgs::JointState jaw;
  jaw.header.stamp = now;
  jaw.name = {"jaw"};
  jaw.position = {jaw_.measured()[0]};
  out_["tool/jaw"].publish(jaw);
  publish_pose("tool", now, parameters_.world_frame, tool);
}

// Real arms follow at a limited speed, and so does this: who asks for more should know.
void ArmNode::say_if_behind() {
  const double way =
      (tip_in_world(arm_.setpoint()).position - tip_in_world(arm_.measured()).position).norm();
  if (way < kBehind || !may_say("behind", 1)) return;
  char text[160];
  std::snprintf(text, sizeof text,
                "the tip falls behind its setpoint by %.1f mm: joints follow at a limited speed "
                "(docs/arm.md)",
                1e3 * way);
  ROS_WARN("%s", text);
  crtk_.warning(ros::Time::now(), text);
}

ros::Time ArmNode::rising(ros::Time stamp, ros::Time& last) const {
  if (stamp <= last) stamp = ros_time_of(in_nanoseconds(last) + 1);
  last = stamp;
  return stamp;
}

void ArmNode::publish_state(bool busy) {
  const ros::Time now = ros::Time::now();
  if (now.isZero()) return;
  published_state_ = state_.state;
  published_busy_ = busy;
  crtk_.operating_state(rising(now, last_state_), state_, published_busy_);
}

bool ArmNode::may_say(const std::string& what, double rest) {
  return said_.try_emplace(what, rest).first->second.due(WallClock::now());
}

void ArmNode::say(const std::string& text) {
  if (!may_say(text, 1)) return;
  ROS_INFO("%s", text.c_str());
  crtk_.info(ros::Time::now(), text);
}

// The simulator's, about the same point, in the world's axes or in the tool's.
void ArmNode::on_wrench(const geometry_msgs::WrenchStamped& message, bool body) {
  const auto vector = [](const geometry_msgs::Vector3& v) { return Vec3(v.x, v.y, v.z); };
  Wrench wrench{vector(message.wrench.force), vector(message.wrench.torque)};
  if (body) {
    const Eigen::AngleAxisd mount(parameters_.mount_angle, Vec3::UnitZ());
    wrench = {mount * wrench.force, mount * wrench.torque};
  } else {
    wrench_ = wrench;
    wrench_came_ = WallClock::now();
    wrench_known_ = true;
  }
  if (message.header.stamp.isZero()) return;  // before /clock
  publish_wrench(rising(message.header.stamp, body ? last_body_wrench_ : last_wrench_), wrench,
                 body);
}

void ArmNode::publish_wrench(const ros::Time& stamp, const Wrench& wrench, bool body) {
  geometry_msgs::WrenchStamped m;
  m.header.stamp = tool_present_ ? stamp : ros::Time();
  m.header.frame_id = body && !absolute_ ? parameters_.tip_frame : parameters_.world_frame;
  m.wrench = to_wrench(wrench);
  if (body && absolute_) {
    m.wrench = to_wrench(in_axes(wrench, tip_in_world(arm_.measured()).orientation.inverse()));
  }
  out_[body ? "body/measured_cf" : "spatial/measured_cf"].publish(m);
}

}  // namespace tissue_sim
