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
      poses_(limits),
      last_came_(WallClock::now()) {
  ros::NodeHandle handle(node);
  const std::string poses = tool.name + "/measured_cp", jaws = tool.name + "/jaw/measured_js";
  jaw_topic_ = node.resolveName(jaws);
  if (tf_frame_.empty()) pose_topic_ = node.resolveName(poses);
  status_.tool = tool.name;
  status_.follows_tf = !tf_frame_.empty();
  status_.source = status_.follows_tf ? tf_frame_ : pose_topic_;
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  // Deep queues: only the newest pose moves the tool, but a recording wants them all.
  const auto take_pose = [this](const auto& event) { on_pose(event); };
  if (!tf_frame_.empty()) {
  } else if (source.pose_type == "TransformStamped") {
    pose_subscriber_ =
        listen<geometry_msgs::TransformStamped>(handle, poses, 1000, take_pose, hints);
  } else {
    pose_subscriber_ = listen<geometry_msgs::PoseStamped>(handle, poses, 1000, take_pose, hints);
  }
  jaw_subscriber_ = listen<sensor_msgs::JointState>(
      handle, jaws, 1000, [this](const auto& event) { on_jaw(event); }, hints);
  if (tool.type != ToolType::kGrasper) return;
  const std::string pressure = tool.name + "/grip_pressure";
  grip_topic_ = node.resolveName(pressure);
  grip_subscriber_ = listen<std_msgs::Float64>(
      handle, pressure, 100,
      [this](const auto& event) { on_grip_pressure(event.getConstMessage()); }, hints);
}

template <class Event>
void ToolInput::on_pose(const Event& event) {
  const auto message = event.getConstMessage();
  recorder_.write(pose_topic_, message, ros::Time::now());
  add(held_poses_, message->header.stamp,
      PoseSample{message->header, pose_in(*message), is_latched(event)});
}

void ToolInput::on_jaw(const ros::MessageEvent<const sensor_msgs::JointState>& event) {
  const sensor_msgs::JointState::ConstPtr message = event.getConstMessage();
  JawSample sample{jaw_angle(*message), is_latched(event)};
  if (message->position.size() > kMostJoints || message->name.size() > kMostJoints) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return accept(sample);  // which refuses it: nothing so large is kept
  }
  recorder_.write(jaw_topic_, message, ros::Time::now());
  add(held_jaws_, message->header.stamp, std::move(sample));
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

template <class Sample>
void ToolInput::add(HeldSamples<Sample>& held, const ros::Time& stamp, Sample&& sample) {
  constexpr bool is_pose = std::is_same_v<Sample, PoseSample>;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_far_ahead(stamp)) {  // one such would hold all up
      const std::string text = "its stamp, " + std::to_string(stamp.sec) +
                               " s, is more than a day ahead of ROS' and the wall's time";
      status_.came = status_.came || is_pose;
      return is_pose ? refuse(Refusal::kStamp, text) : refuse_jaw(text);
    }
    if (!on_sample_) return accept(sample);
    const ros::Time now = ros::Time::now();
    if (held.add(in_nanoseconds(stamp.isZero() ? now : stamp), std::move(sample), WallClock::now(),
                 in_nanoseconds(now))) {
      ++late_;
      ROS_WARN_ONCE("%s: samples are lost, for they come faster than frames take them",
                    tool().c_str());
    }
    came_since_ = came_since_ || is_pose;
  }
  on_sample_();
}

void ToolInput::accept(const JawSample& sample) {
  jaw_latched_ = sample.latched;
  if (!sample.jaw.problem.empty()) return refuse_jaw(sample.jaw.problem);
  jaw_problem_.clear();
  jaws_.add(sample.jaw.angle, now());
}

void ToolInput::accept(const PoseSample& sample) {
  const std_msgs::Header& header = sample.header;
  status_.latched = sample.latched;
  status_.came = true;
  last_came_ = WallClock::now();
  if (publishes_tf_ && (header.frame_id == tool() || header.frame_id == "/" + tool())) {
    return refuse(Refusal::kOwnFrame,
                  "its frame_id '" + header.frame_id +
                      "' is the frame that this node publishes for the tool: give it in the frame "
                      "of the arm's base, or set publish_tf to false");
  }
  Pose frame;
  try {
    frame = frames_.in_world(header.frame_id, header.stamp);
  } catch (const tf2::TransformException& e) {
    return refuse(Refusal::kUnknownFrame, e.what());
  }
  use(frame, sample.pose, header.stamp);
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
    status_.waiting = e.what();
    if (may_warn()) ROS_WARN("%s waits for a transform: %s", tool().c_str(), e.what());
    return;
  }
  status_.waiting.clear();
  if (poses_.has_come() && stamp == tf_stamp_ && !stamp.isZero()) return;  // nothing new
  tf_stamp_ = stamp;
  status_.came = true;
  last_came_ = WallClock::now();
  use(pose, Pose(), stamp);
}

void ToolInput::use(const Pose& frame, const Pose& in_frame, const ros::Time& stamp) {
  // Where /clock begins anew (a bag that loops) so do the stamps; the wall's is only corrected a
  // bit. Where samples are held, restart() says so.
  const ros::Time ros_now = ros::Time::now();
  if (!on_sample_ && seconds_between(ros_now, newest_time_) > 0.1) poses_.begin_anew();
  newest_time_ = ros_now;
  const PoseTrack::Verdict verdict =
      poses_.add(frame * in_frame, (stamp.isZero() ? ros_now : stamp).toSec(), now());
  const double norm = in_frame.orientation.norm();
  if (is_rounded(norm) && !std::exchange(rounded_, true)) {
    ROS_WARN("%s: a quaternion has norm %.3g, is normalised, and so are all from 0.9 to 1.1",
             tool().c_str(), norm);
  }
  if (verdict.refusal) return refuse(*verdict.refusal, verdict.text);
  ++status_.counts.accepted;
  placed_ = placed_ || verdict.placed;  // until it was taken, whatever comes after it is, too
  status_.far = distance_warning(tissue_, frame, in_frame.position);
  if (!status_.far.empty() && !std::exchange(warned_of_distance_, true)) {
    ROS_WARN("%s is %s", tool().c_str(), status_.far.c_str());
  }
  if (verdict.text.empty()) return;
  ++status_.counts.placed;
  if (may_warn()) {
    ROS_WARN("%s is placed at its new pose, without moving there: %s", tool().c_str(),
             verdict.text.c_str());
  }
}

void ToolInput::refuse(Refusal refusal, const std::string& text) {
  const auto why = static_cast<std::size_t>(refusal);
  ++status_.counts.refused[why];
  if (!may_warn()) return;
  ROS_WARN("%s: pose refused (%s): %s; %lu refused so far", tool().c_str(), kRefusals[why],
           text.c_str(), static_cast<unsigned long>(status_.counts.all_refused()));
}

void ToolInput::refuse_jaw(const std::string& text) {
  ++status_.counts.jaws_refused;
  if (text == jaw_problem_ || !may_warn()) return;
  jaw_problem_ = text;
  ROS_WARN("%s: jaw angle refused: %s", tool().c_str(), text.c_str());
}

bool ToolInput::may_warn() {
  const WallTime now = WallClock::now();
  if (last_warning_ != WallTime() && now - last_warning_ < std::chrono::seconds(1)) return false;
  last_warning_ = now;
  return true;
}

void ToolInput::ask(std::int64_t until, std::optional<ToolRequest>& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (on_sample_) {
    const auto use = [this](std::int64_t stamp, const auto& sample, bool late) {
      late_ += late;
      held_now_ = stamp * 1e-9;
      accept(sample);
    };
    held_jaws_.take(until, WallClock::now(), use);
    held_poses_.take(until, WallClock::now(), use);
    if (is_stamp(until)) held_now_ = ros_time_of(until).toSec();
  }
  if (!tf_frame_.empty()) follow_tf(is_stamp(until) ? ros_time_of(until) : ros::Time());
  if (!poses_.is_known()) return;
  const double time = now();
  request.emplace();
  request->pose = interpolates_ ? poses_.at(time) : poses_.newest();
  if (jaws_.has_come()) request->jaw = interpolates_ ? jaws_.at(time) : jaws_.newest();
  request->placed = std::exchange(placed_, false);
  request->grip_pressure = grip_pressure_;
}

void ToolInput::begin() {
  held_poses_.begin();
  held_jaws_.begin();
  late_ = 0;
}

void ToolInput::rewind() {
  const std::lock_guard<std::mutex> lock(mutex_);
  begin();
  poses_.rewind(now());
  placed_ = poses_.is_known();
}

void ToolInput::go_on(const ToolMotion& state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  begin();
  placed_ = false;
  poses_.go_on(state.end);
  jaws_.place(state.jaw_end, now());
  grip_pressure_.reset();
}

void ToolInput::restart(const ros::Time& before, const ros::Time& now) {
  const std::lock_guard<std::mutex> lock(mutex_);
  begin();
  held_poses_.restart(in_nanoseconds(before), in_nanoseconds(now));
  held_jaws_.restart(in_nanoseconds(before), in_nanoseconds(now));
  status_.latched ? poses_.begin_anew() : poses_.forget();
  placed_ = placed_ || poses_.is_known();
  came_since_ = poses_.is_known() || held_poses_.first(WallClock::now());
  if (!jaw_latched_) jaws_.forget();
}

ToolInput::Held ToolInput::held() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const WallTime now = WallClock::now();
  const bool jaws = has_jaws(tool_.type) && jaw_subscriber_.getNumPublishers() > 0;
  Held held;
  held.first = held_poses_.first(now);
  held.has_next = held.first && (!jaws || held_jaws_.first(now));
  held.connected = pose_subscriber_.getNumPublishers() > 0;
  held.awaited = held.connected && !came_since_;
  return held;
}

std::uint64_t ToolInput::late() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return late_;
}

std::set<std::string> ToolInput::topics() const {
  std::set<std::string> topics = {pose_topic_, jaw_topic_, grip_topic_};
  topics.erase("");
  return topics;
}

ToolStatus ToolInput::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  ToolStatus s = status_;
  s.publishers = pose_subscriber_.getNumPublishers();
  s.silent = std::chrono::duration<double>(WallClock::now() - last_came_).count();
  return s;
}

}  // namespace tissue_sim
