#include "ros/tool_input.h"

#include <ros/console.h>

#include <cmath>
#include <numeric>

#include "ros/conversions.h"

namespace tissue_sim {

std::uint64_t ToolInput::Counts::all_refused() const {
  return std::accumulate(refused.begin(), refused.end(), std::uint64_t{0});
}

ToolInput::ToolInput(const ros::NodeHandle& node, const std::string& tool,
                     const ToolParameters& source, const PoseLimits& limits, const Frames& frames,
                     Recorder& recorder)
    : tool_(tool),
      tf_frame_(source.tf_frame),
      frames_(frames),
      recorder_(recorder),
      check_(limits) {
  ros::NodeHandle handle(node);
  pose_topic_ = node.resolveName(tool + "/measured_cp");
  jaw_topic_ = node.resolveName(tool + "/jaw/measured_js");
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  // Deep queues: only the newest pose moves the tool, but a recording wants them all.
  if (!tf_frame_.empty()) {
    pose_topic_.clear();
  } else if (source.pose_type == "TransformStamped") {
    pose_subscriber_ =
        handle.subscribe(tool + "/measured_cp", 1000, &ToolInput::on_transform, this, hints);
  } else {
    pose_subscriber_ =
        handle.subscribe(tool + "/measured_cp", 1000, &ToolInput::on_pose, this, hints);
  }
  jaw_subscriber_ =
      handle.subscribe(tool + "/jaw/measured_js", 1000, &ToolInput::on_jaw, this, hints);
}

void ToolInput::on_pose(const geometry_msgs::PoseStamped::ConstPtr& message) {
  recorder_.write(pose_topic_, message, ros::Time::now());
  accept(message->header, from_message(message->pose));
}

void ToolInput::on_transform(const geometry_msgs::TransformStamped::ConstPtr& message) {
  recorder_.write(pose_topic_, message, ros::Time::now());
  accept(message->header, from_message(message->transform));
}

void ToolInput::accept(const std_msgs::Header& header, const Pose& in_frame) {
  Pose frame;
  try {
    frame = frames_.in_world(header.frame_id, header.stamp);
  } catch (const tf2::TransformException& e) {
    const std::lock_guard<std::mutex> lock(mutex_);
    refuse(Refusal::kUnknownFrame, e.what());
    return;
  }
  check(frame * in_frame, header.stamp.isZero() ? ros::Time::now() : header.stamp);
}

void ToolInput::follow_tf() {
  ros::Time stamp;
  Pose pose;
  try {
    pose = frames_.newest(tf_frame_, stamp);
  } catch (const tf2::TransformException& e) {
    const std::lock_guard<std::mutex> lock(mutex_);
    refuse(Refusal::kUnknownFrame, e.what());
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (sample_ && stamp == tf_stamp_ && !stamp.isZero()) return;  // nothing new
    tf_stamp_ = stamp;
  }
  check(pose, stamp.isZero() ? ros::Time::now() : stamp);
}

void ToolInput::check(Pose pose, const ros::Time& stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const PoseCheck::Verdict verdict = check_.check(pose, stamp.toSec());
  if (verdict.refusal) {
    refuse(*verdict.refusal, verdict.text);
    return;
  }
  ++counts_.accepted;
  if (verdict.placed && sample_) {
    ++counts_.placed;
    ROS_WARN("%s is placed anew, without moving there: its pose is %s", tool_.c_str(),
             verdict.text.c_str());
  }
  if (!sample_) sample_ = Sample();
  sample_->pose = pose;
  sample_->placed = verdict.placed || (fresh_ && sample_->placed);
  fresh_ = true;
}

void ToolInput::refuse(Refusal refusal, const std::string& text) {
  ++counts_.refused[static_cast<int>(refusal)];
  ROS_WARN_THROTTLE(1, "%s: pose refused (%s): %s; %lu refused so far", tool_.c_str(),
                    name_of(refusal), text.c_str(),
                    static_cast<unsigned long>(counts_.all_refused()));
}

void ToolInput::on_jaw(const sensor_msgs::JointState::ConstPtr& message) {
  recorder_.write(jaw_topic_, message, ros::Time::now());
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message->position.empty() || !std::isfinite(message->position.front())) {
    ++counts_.jaws_refused;
    ROS_WARN_THROTTLE(1, "%s: jaw angle refused: %s", tool_.c_str(),
                      message->position.empty() ? "the message has no position" : "not finite");
    return;
  }
  jaw_ = message->position.front();
  fresh_ = true;
}

std::optional<ToolInput::Sample> ToolInput::take() {
  if (!tf_frame_.empty()) follow_tf();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!fresh_ || !sample_) return std::nullopt;
  Sample sample = *sample_;
  sample.jaw = jaw_;
  fresh_ = false;
  sample_->placed = false;
  return sample;
}

void ToolInput::rewind() {
  const std::lock_guard<std::mutex> lock(mutex_);
  fresh_ = sample_.has_value();
  if (sample_) sample_->placed = true;
}

ToolInput::Counts ToolInput::counts() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return counts_;
}

}  // namespace tissue_sim
