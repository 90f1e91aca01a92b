// ToolInput: where one instrument is, from its topics or from tf, checked.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>

#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "ros/frames.h"
#include "ros/pace.h"
#include "ros/parameters.h"
#include "ros/pose_check.h"
#include "ros/recorder.h"
#include "ros/sample_track.h"
#include "ros/tool_status.h"
#include "tissue_sim/tool.h"

namespace tissue_sim {

/// Thread-safe. Callbacks come on the node handle's queue.
class ToolInput {
 public:
  /// `tissue` is the box of all tissue as it is at the start [m].
  ToolInput(const ros::NodeHandle& node, const Tool& tool, const ToolParameters& source,
            const PoseLimits& limits, const Frames& frames, const Box& tissue, Recorder& recorder);

  struct Sample {
    Pose pose;                 ///< world frame
    double jaw = 0;            ///< [rad]
    double grip_pressure = 0;  ///< [Pa], 0 for the scene's
    bool placed = false;       ///< did not move there from where the tool was
    bool fresh = false;        ///< a pose or an angle came since the last one was taken
  };
  /// Where the tool shall be now: as the newest sample says or, with interpolation, on the way to
  /// it. None before the first pose. Where the tool follows tf, looks there.
  std::optional<Sample> take();
  /// The newest sample counts as fresh and as placed, and the next pose as the first: for a
  /// simulation that starts anew, and its instruments' time with it.
  void rewind();

  ToolStatus status() const;
  const std::string& tool() const { return tool_.name; }
  /// What it listens to, for a recording.
  std::set<std::string> topics() const;

 private:
  void on_pose(const geometry_msgs::PoseStamped::ConstPtr& message);
  void on_transform(const geometry_msgs::TransformStamped::ConstPtr& message);
  void on_jaw(const sensor_msgs::JointState::ConstPtr& message);
  void on_grip_pressure(const std_msgs::Float64::ConstPtr& message);
  void follow_tf();
  void accept(const std_msgs::Header& header, const Pose& in_frame);
  void check(const Pose& frame, const Pose& in_frame, const ros::Time& stamp);
  void refuse(Refusal refusal, const std::string& text);
  void forget_if_time_jumped_back();
  /// Whether a warning is due again, once a second by the wall's clock.
  bool may_warn();

  const Tool tool_;
  const std::string tf_frame_;
  const bool interpolates_;
  const Frames& frames_;
  const Box tissue_;
  Recorder& recorder_;
  std::string pose_topic_, jaw_topic_, grip_topic_;  // resolved

  mutable std::mutex mutex_;  // of what follows
  PoseCheck check_;
  PoseCounts counts_;
  std::optional<Sample> sample_;
  SampleTrack<Pose> pose_track_;
  SampleTrack<double> jaw_track_;
  double jaw_ = 0, grip_pressure_ = 0;
  bool jaw_came_ = false, came_ = false, rounded_ = false, warned_of_distance_ = false;
  ros::Time tf_stamp_, newest_time_;
  WallTime last_came_;  // or when it began to listen
  WallTime last_warning_;
  std::string waiting_, far_;  // see ToolStatus

  ros::Subscriber pose_subscriber_, jaw_subscriber_, grip_subscriber_;  // last: end before the rest
};

}  // namespace tissue_sim
