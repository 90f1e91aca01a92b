#include "ros/tool_input.h"

#include <ros/console.h>

#include <cmath>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/jaw_check.h"
#include "ros/stamps.h"

namespace tissue_sim {
namespace {

template <class M>
bool is_latched(const ros::MessageEvent<M>& event) {
  const ros::M_string& header = event.getConnectionHeader();
  const auto latching = header.find("latching");
  return latching != header.end() && latching->second == "1";
}

}  // namespace

ToolInput::ToolInput(const ros::NodeHandle& node, const Tool& tool, const ToolParameters& source,
                     const PoseLimits& limits, const Frames& frames, const Box& tissue,
                     Recorder& recorder, std::function<void()> on_sample, bool publishes_tf)
    : tool_(tool),
      tf_frame_(source.tf_frame),
      interpolates_(source.interpolate == "linear"),
      publishes_tf_(publishes_tf),
      frames_(frames),
      tissue_(tissue),
      recorder_(recorder),
      on_sample_(std::move(on_sample)),
      check_(limits),
      last_came_(WallClock::now()) {
  ros::NodeHandle handle(node);
  const std::string poses = tool.name + "/measured_cp", jaws = tool.name + "/jaw/measured_js";
  pose_topic_ = node.resolveName(poses);
  jaw_topic_ = node.resolveName(jaws);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  // Deep queues: only the newest pose moves the tool, but a recording wants them all.
  if (!tf_frame_.empty()) {
    pose_topic_.clear();
  } else if (source.pose_type == "TransformStamped") {
    pose_subscriber_ = listen<geometry_msgs::TransformStamped>(
        handle, poses, 1000, [this](const auto& event) { on_transform(event); }, hints);
  } else {
    pose_subscriber_ = listen<geometry_msgs::PoseStamped>(
        handle, poses, 1000, [this](const auto& event) { on_pose(event); }, hints);
  }
  jaw_subscriber_ = listen<sensor_msgs::JointState>(
      handle, jaws, 1000, [this](const auto& event) { on_jaw(event); }, hints);
  if (tool.type == ToolType::kGrasper) {
    const std::string pressure = tool.name + "/grip_pressure";
    grip_topic_ = node.resolveName(pressure);
    grip_subscriber_ = listen<std_msgs::Float64>(
        handle, pressure, 100,
        [this](const auto& event) { on_grip_pressure(event.getConstMessage()); }, hints);
  }
}

std::set<std::string> ToolInput::topics() const {
  std::set<std::string> topics = {jaw_topic_};
  if (!pose_topic_.empty()) topics.insert(pose_topic_);
  if (!grip_topic_.empty()) topics.insert(grip_topic_);
  return topics;
}

double ToolInput::now() const { return on_sample_ ? held_now_ : seconds(WallClock::now()); }

void ToolInput::on_pose(const ros::MessageEvent<const geometry_msgs::PoseStamped>& event) {
  const geometry_msgs::PoseStamped::ConstPtr message = event.getConstMessage();
  recorder_.write(pose_topic_, message, ros::Time::now());
  const bool latched = is_latched(event);
  hold(held_poses_, message->header.stamp, [this, message, latched] {
    pose_latched_ = latched;
    accept(message->header, from_message(message->pose));
  });
}

void ToolInput::on_transform(
    const ros::MessageEvent<const geometry_msgs::TransformStamped>& event) {
  const geometry_msgs::TransformStamped::ConstPtr message = event.getConstMessage();
  recorder_.write(pose_topic_, message, ros::Time::now());
  const bool latched = is_latched(event);
  hold(held_poses_, message->header.stamp, [this, message, latched] {
    pose_latched_ = latched;
    accept(message->header, from_message(message->transform));
  });
}

void ToolInput::accept(const std_msgs::Header& header, const Pose& in_frame) {
  Pose frame;
  if (publishes_tf_ && (header.frame_id == tool() || header.frame_id == "/" + tool())) {
    const std::lock_guard<std::mutex> lock(mutex_);
    came_ = true;
    last_came_ = WallClock::now();
    refuse(Refusal::kOwnFrame, "its frame_id '" + header.frame_id +
                                   "' is the frame that this node publishes for the tool: give it "
                                   "in the frame of the arm's base, or set publish_tf to false");
    return;
  }
  try {
    frame = frames_.in_world(header.frame_id, header.stamp);
  } catch (const tf2::TransformException& e) {
    const std::lock_guard<std::mutex> lock(mutex_);
    came_ = true;
    last_came_ = WallClock::now();
    refuse(Refusal::kUnknownFrame, e.what());
    return;
  }
  check(frame, in_frame, header.stamp.isZero() ? ros::Time::now() : header.stamp);
}

void ToolInput::follow_tf(const ros::Time& at) {
  ros::Time stamp = at;
  Pose pose;
  try {
    try {
      pose = at.isZero() ? frames_.newest(tf_frame_, stamp) : frames_.in_world(tf_frame_, at);
    } catch (const tf2::ExtrapolationException&) {
      pose = frames_.newest(tf_frame_, stamp);
    }
  } catch (const tf2::TransformException& e) {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_ = e.what();
    if (may_warn()) ROS_WARN("%s waits for a transform: %s", tool().c_str(), e.what());
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_.clear();
    if (sample_ && stamp == tf_stamp_ && !stamp.isZero()) return;  // nothing new
    tf_stamp_ = stamp;
  }
  check(pose, Pose(), stamp.isZero() ? ros::Time::now() : stamp);
}

// Where /clock begins anew (a bag that loops) so do the stamps; the wall's is only corrected a bit.
void ToolInput::forget_if_time_jumped_back() {
  if (on_sample_) return;  // restart() says so
  const ros::Time now = ros::Time::now();
  if (seconds_between(now, newest_time_) > 0.1) check_.forget();
  newest_time_ = now;
}

void ToolInput::check(const Pose& frame, const Pose& in_frame, const ros::Time& stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  came_ = true;
  last_came_ = WallClock::now();
  forget_if_time_jumped_back();
  if (is_rotation(in_frame.orientation) && is_rounded(in_frame.orientation) && !rounded_) {
    rounded_ = true;
    ROS_WARN("%s: a quaternion has norm %.3g, is normalised, and so are all from 0.9 to 1.1",
             tool().c_str(), in_frame.orientation.norm());
  }
  Pose pose = frame * in_frame;
  const PoseCheck::Verdict verdict = check_.check(pose, stamp.toSec(), now());
  if (verdict.refusal) {
    refuse(*verdict.refusal, verdict.text);
    return;
  }
  ++counts_.accepted;
  far_ = distance_warning(tissue_, frame, in_frame.position);
  if (!far_.empty() && !warned_of_distance_) {
    warned_of_distance_ = true;
    ROS_WARN("%s is %s", tool().c_str(), far_.c_str());
  }
  if (verdict.placed && sample_ && !verdict.text.empty()) {
    ++counts_.placed;
    if (may_warn()) {
      ROS_WARN("%s is placed at its new pose, without moving there: %s", tool().c_str(),
               verdict.text.c_str());
    }
  }
  if (verdict.placed || !sample_) {
    pose_track_.place(pose, now());
  } else {
    pose_track_.add(pose, now());
  }
  if (!sample_) sample_ = ToolRequest();
  sample_->pose = pose;
  // Until the placed one was taken, whatever comes after it is placed, too.
  sample_->placed = sample_->placed || verdict.placed;
}

void ToolInput::refuse(Refusal refusal, const std::string& text) {
  ++counts_.refused[static_cast<std::size_t>(refusal)];
  if (!may_warn()) return;
  ROS_WARN("%s: pose refused (%s): %s; %lu refused so far", tool().c_str(), name_of(refusal),
           text.c_str(), static_cast<unsigned long>(counts_.all_refused()));
}

bool ToolInput::may_warn() {
  const WallTime now = WallClock::now();
  if (last_warning_ != WallTime() && now - last_warning_ < std::chrono::seconds(1)) return false;
  last_warning_ = now;
  return true;
}

void ToolInput::on_jaw(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  const sensor_msgs::JointState::ConstPtr message = event.getConstMessage();
  if (message->position.size() > kMostJoints || message->name.size() > kMostJoints) {
    return accept_jaw(*message);  // which refuses it: nothing so large is kept
  }
  recorder_.write(jaw_topic_, message, ros::Time::now());
  const bool latched = is_latched(event);
  hold(held_jaws_, message->header.stamp, [this, message, latched] {
    jaw_latched_ = latched;
    accept_jaw(*message);
  });
}

void ToolInput::accept_jaw(const sensor_msgs::JointState& message) {
  const JawAngle jaw = jaw_angle(message);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!jaw.problem.empty()) {
    ++counts_.jaws_refused;
    if (may_warn()) ROS_WARN("%s: jaw angle refused: %s", tool().c_str(), jaw.problem.c_str());
    return;
  }
  if (jaw_came_) {
    jaw_track_.add(jaw.angle, now());
  } else {
    jaw_track_.place(jaw.angle, now());
  }
  jaw_came_ = true;
  jaw_ = jaw.angle;
}

void ToolInput::on_grip_pressure(const std_msgs::Float64::ConstPtr& message) {
  recorder_.write(grip_topic_, message, ros::Time::now());
  const std::lock_guard<std::mutex> lock(mutex_);
  const double pressure = message->data;
  if (pressure == 0 || (pressure >= 1 && pressure <= 1e7)) {
    grip_pressure_ = pressure;
  } else if (may_warn()) {
    ROS_WARN("%s: grip_pressure %g refused: must be from 1 to 1e7 Pa, or 0 for the scene's",
             tool().c_str(), pressure);
  }
}

std::optional<ToolRequest> ToolInput::take() {
  release(Held::kAll);
  return take_released(ros::Time());
}

std::optional<ToolRequest> ToolInput::take_released(const ros::Time& at) {
  if (!tf_frame_.empty()) follow_tf(at);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!sample_) return std::nullopt;
  ToolRequest sample = *sample_;
  sample.jaw = jaw_;
  sample.grip_pressure = grip_pressure_;
  if (interpolates_) {
    sample.pose = pose_track_.at(now());
    if (jaw_came_) sample.jaw = jaw_track_.at(now());
  }
  sample_->placed = false;
  return sample;
}

void ToolInput::rewind() {
  const std::lock_guard<std::mutex> lock(mutex_);
  check_.forget();
  if (!sample_) return;
  sample_->placed = true;
  pose_track_.place(sample_->pose, now());
}

ToolStatus ToolInput::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ToolStatus s;
  s.tool = tool();
  s.follows_tf = !tf_frame_.empty();
  s.source = s.follows_tf ? tf_frame_ : pose_topic_;
  s.publishers = pose_subscriber_.getNumPublishers();
  s.waiting = waiting_;
  s.latched = pose_latched_;
  s.came = came_;
  s.silent = std::chrono::duration<double>(WallClock::now() - last_came_).count();
  s.far = far_;
  s.counts = counts_;
  return s;
}

}  // namespace tissue_sim
