#include "ros/tool_input.h"

#include <geometry_msgs/TransformStamped.h>
#include <ros/console.h>

#include <cmath>
#include <type_traits>
#include <utility>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/stamps.h"

namespace tissue_sim {
namespace {

template <class M>
bool is_latched(const ros::MessageEvent<M>& event) {
  const ros::M_string& header = event.getConnectionHeader();
  const auto latching = header.find("latching");
  return latching != header.end() && latching->second == "1";
}

Pose pose_in(const geometry_msgs::PoseStamped& message) { return from_message(message.pose); }
Pose pose_in(const geometry_msgs::TransformStamped& message) {
  return from_message(message.transform);
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
        handle, poses, 1000, [this](const auto& event) { on_pose(event); }, hints);
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

template <class Event>
void ToolInput::on_pose(const Event& event) {
  const auto message = event.getConstMessage();
  recorder_.write(pose_topic_, message, ros::Time::now());
  add(held_poses_, message->header.stamp,
      PoseSample{message->header, pose_in(*message), is_latched(event)});
}

void ToolInput::on_jaw(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  const sensor_msgs::JointState::ConstPtr message = event.getConstMessage();
  const JawSample sample{jaw_angle(*message), is_latched(event)};
  if (message->position.size() > kMostJoints || message->name.size() > kMostJoints) {
    return accept(sample);  // which refuses it: nothing so large is kept
  }
  recorder_.write(jaw_topic_, message, ros::Time::now());
  add(held_jaws_, message->header.stamp, sample);
}

template <class Sample>
void ToolInput::add(HeldSamples<Sample>& held, const ros::Time& stamp, Sample sample) {
  constexpr bool is_pose = std::is_same_v<Sample, PoseSample>;
  if (has_wrong_stamp(stamp, is_pose)) return;  // one such would hold all up
  if (!on_sample_) {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    return accept(sample);
  }
  bool dropped = false;
  {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    const ros::Time time = stamp.isZero() ? ros::Time::now() : stamp;
    dropped = held.add(in_nanoseconds(time), std::move(sample), WallClock::now(),
                       in_nanoseconds(ros::Time::now()));
    late_ += dropped;
    came_since_ = came_since_ || is_pose;
  }
  if (dropped) {
    ROS_WARN_ONCE("%s: samples are lost, for they come faster than frames take them",
                  tool().c_str());
  }
  on_sample_();
}

void ToolInput::accept(const PoseSample& sample) {
  const std_msgs::Header& header = sample.header;
  pose_latched_ = sample.latched;
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
  use(frame, sample.pose, header.stamp.isZero() ? ros::Time::now() : header.stamp);
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
    if (poses_.has_come() && stamp == tf_stamp_ && !stamp.isZero()) return;  // nothing new
    tf_stamp_ = stamp;
  }
  use(pose, Pose(), stamp.isZero() ? ros::Time::now() : stamp);
}

// Where /clock begins anew (a bag that loops) so do the stamps; the wall's is only corrected a bit.
void ToolInput::forget_if_time_jumped_back() {
  if (on_sample_) return;  // restart() says so
  const ros::Time now = ros::Time::now();
  if (seconds_between(now, newest_time_) > 0.1) check_.forget();
  newest_time_ = now;
}

void ToolInput::use(const Pose& frame, const Pose& in_frame, const ros::Time& stamp) {
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
  if (verdict.placed && poses_.has_come() && !verdict.text.empty()) {
    ++counts_.placed;
    if (may_warn()) {
      ROS_WARN("%s is placed at its new pose, without moving there: %s", tool().c_str(),
               verdict.text.c_str());
    }
  }
  const bool goes_on = goes_on_from_ && check_.reachable(*goes_on_from_, pose);
  goes_on_from_.reset();
  if (verdict.placed) {
    poses_.place(pose, now());
  } else {
    poses_.add(pose, now());
  }
  // Until the placed one was taken, whatever comes after it is placed, too.
  placed_ = placed_ || (verdict.placed && !goes_on);
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

void ToolInput::accept(const JawSample& sample) {
  jaw_latched_ = sample.latched;
  const JawAngle& jaw = sample.jaw;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!jaw.problem.empty()) {
    ++counts_.jaws_refused;
    if (jaw.problem != jaw_problem_ && may_warn()) {
      ROS_WARN("%s: jaw angle refused: %s", tool().c_str(), jaw.problem.c_str());
      jaw_problem_ = jaw.problem;
    }
    return;
  }
  jaw_problem_.clear();
  jaws_.add(jaw.angle, now());
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

void ToolInput::rewind() {
  const std::lock_guard<std::mutex> lock(mutex_);
  check_.forget();
  goes_on_from_.reset();
  if (!poses_.has_come()) return;
  placed_ = true;
  poses_.place(poses_.newest(), now());
}

void ToolInput::go_on(const ToolMotion& state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  check_.forget();
  placed_ = false;
  goes_on_from_ = state.end;
  jaws_.place(state.jaw_end, now());
  grip_pressure_.reset();
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
