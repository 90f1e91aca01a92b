// A CRTK arm without a robot: takes the motions that clients ask for, moves a tool of the simulator
// and passes on what the tissue does to it. One thread.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Empty.h>
#include <std_msgs/Float64.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <map>
#include <string>
#include <vector>

#include "arm/joint_group.h"
#include "ros/arm/arm_parameters.h"
#include "ros/arm/crtk_topics.h"
#include "ros/messages.h"
#include "ros/warn_seldom.h"

namespace tissue_sim {

class ArmNode {
 public:
  ArmNode(ros::NodeHandle& node, const ArmParameters& parameters);

  /// Until ROS shuts down. Goes by ROS time: while /clock stands still, so does the arm.
  void run();

 private:
  enum class Kind { kServo, kMove, kForce };

  // arm_commands.cpp
  void subscribe();
  template <class M, class Callback>
  void listen(const std::string& name, int queue, Callback callback);
  void refuse(const std::string& name, const std::string& why, Kind kind, JointGroup& group);
  void ask(const std::string& name, Kind kind, JointGroup& group, const JointVector& goal,
           const JointVector& velocity = {});
  void on_joints(const std::string& name, Kind kind, JointGroup& group,
                 const sensor_msgs::JointState& goal, bool relative);
  void on_pose(const std::string& name, Kind kind, const geometry_msgs::PoseStamped& goal,
               bool relative);
  void on_twist(const geometry_msgs::TwistStamped& velocity);
  void step_by_twist(const ros::Time& now, double seconds);
  void on_state_command(const std::string& word);
  void on_ratio(double ratio);
  void stop(const std::string& name);
  std::string world_pose(const geometry_msgs::PoseStamped& message, Pose& pose) const;
  std::string forward(const std::vector<double>& joints, bool local, Pose& tip) const;
  std::string inverse(const Pose& tip, const std::vector<double>& seed,
                      std::vector<double>& joints) const;

  // arm_node.cpp
  void advertise();
  void tick(const ros::Time& now, double seconds);
  void publish(const ros::Time& now, bool valid);
  void publish_joints(const std::string& name, const ros::Time& stamp, const JointGroup& group,
                      bool setpoint);
  void publish_pose(const std::string& name, const ros::Time& stamp, const std::string& frame,
                    const Pose& pose);
  void publish_jacobians();
  void drive_tool(const ros::Time& now);
  void say_if_behind();
  void publish_state(bool busy);
  bool busy() const { return arm_.busy() || jaw_.busy(); }
  /// Whether this was not said for `rest` seconds.
  bool may_say(const std::string& what, double rest);
  void say(const std::string& text);
  void on_wrench(const geometry_msgs::WrenchStamped& message, bool body);
  void publish_wrench(const ros::Time& stamp, const Wrench& wrench, bool body);
  Pose tip_in_world(const JointVector& joints) const;
  ros::Time rising(ros::Time stamp, ros::Time& last) const;

  ros::NodeHandle& node_;
  const ArmParameters parameters_;
  JointGroup arm_, jaw_;
  OperatingState state_;
  double ratio_ = 1;      // of the speeds of moves
  Wrench twist_;          // asked for by servo_cv, along the world's axes [m/s, rad/s]
  ros::Time twist_came_;  // zero: none goes on
  bool tool_present_ = true, absolute_ = false;
  std::string published_state_;
  bool published_busy_ = false;
  ros::Time last_, last_state_, last_wrench_, last_body_wrench_;
  WallTime wrench_came_, shown_still_;
  bool wrench_known_ = false;
  Wrench wrench_;  // on the tip, in the world's axes
  double grip_angle_ = 0, grip_moment_ = 0;
  WallTime grip_came_;
  bool grip_known_ = false;
  int ticks_ = 0;

  std::map<std::string, ros::Publisher> out_;
  std::vector<ros::Subscriber> in_;
  std::map<std::string, Seldom> said_;
  tf2_ros::Buffer frames_;
  tf2_ros::TransformListener listener_;
  tf2_ros::StaticTransformBroadcaster base_broadcaster_;
  tf2_ros::TransformBroadcaster tip_broadcaster_;
  CrtkTopics crtk_;
};

}  // namespace tissue_sim
