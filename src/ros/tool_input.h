// ToolInput: where one instrument is, from its topics or from tf, checked.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "ros/frames.h"
#include "ros/parameters.h"
#include "ros/pose_check.h"
#include "ros/recorder.h"

namespace tissue_sim {

/// Thread-safe. Callbacks come on the node handle's queue.
class ToolInput {
 public:
  ToolInput(const ros::NodeHandle& node, const std::string& tool, const ToolParameters& source,
            const PoseLimits& limits, const Frames& frames, Recorder& recorder);

  struct Sample {
    Pose pose;            ///< world frame
    double jaw = 0;       ///< [rad]
    bool placed = false;  ///< did not move there from where the tool was
  };
  /// The newest sample; none if it was taken already. Where the tool follows tf, looks there.
  std::optional<Sample> take();
  /// The newest sample counts as not taken and as placed: for a simulation that starts anew.
  void rewind();

  struct Counts {
    std::uint64_t accepted = 0;
    std::uint64_t placed = 0;
    std::array<std::uint64_t, kRefusalCount> refused{};
    std::uint64_t jaws_refused = 0;
    std::uint64_t all_refused() const;
  };
  Counts counts() const;
  const std::string& tool() const { return tool_; }
  const std::string& pose_topic() const { return pose_topic_; }
  const std::string& jaw_topic() const { return jaw_topic_; }

 private:
  void on_pose(const geometry_msgs::PoseStamped::ConstPtr& message);
  void on_transform(const geometry_msgs::TransformStamped::ConstPtr& message);
  void on_jaw(const sensor_msgs::JointState::ConstPtr& message);
  void follow_tf();
  void accept(const std_msgs::Header& header, const Pose& in_frame);
  void check(Pose pose, const ros::Time& stamp);
  void refuse(Refusal refusal, const std::string& text);

  const std::string tool_, tf_frame_;
  const Frames& frames_;
  Recorder& recorder_;
  std::string pose_topic_, jaw_topic_;  // resolved

  mutable std::mutex mutex_;  // of what follows
  PoseCheck check_;
  Counts counts_;
  std::optional<Sample> sample_;
  double jaw_ = 0;
  bool fresh_ = false;
  ros::Time tf_stamp_;

  ros::Subscriber pose_subscriber_, jaw_subscriber_;  // last: end before what they call
};

}  // namespace tissue_sim
