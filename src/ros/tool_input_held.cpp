// Samples of an instrument that wait for the frame that they are for: by stamp or one by one.
#include <ros/console.h>

#include <utility>

#include "ros/stamps.h"
#include "ros/tool_input.h"

namespace tissue_sim {

bool ToolInput::has_wrong_stamp(const ros::Time& stamp, bool is_pose) {
  if (!is_far_ahead(stamp)) return false;
  const std::lock_guard<std::mutex> lock(mutex_);
  came_ = came_ || is_pose;
  const std::string text = "its stamp, " + std::to_string(stamp.sec) +
                           " s, is more than a day ahead of ROS' and the wall's time";
  if (is_pose) {
    refuse(Refusal::kStamp, text);
  } else {
    ++counts_.jaws_refused;
    if (may_warn()) ROS_WARN("%s: jaw angle refused: %s", tool().c_str(), text.c_str());
  }
  return true;
}

std::optional<ToolRequest> ToolInput::at(std::int64_t until) {
  const bool by_stamp = until != kAll && until != kNext;
  if (on_sample_) {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    const WallTime wall = WallClock::now();
    const auto take = [&](auto& held) {
      const auto use = [&](std::int64_t stamp, const auto& sample, bool late) {
        late_ += late;
        held_now_ = stamp * 1e-9;
        accept(sample);
      };
      until == kNext ? held.next(wall, use) : held.take(until, wall, use);
    };
    take(held_jaws_);
    take(held_poses_);
    if (by_stamp) held_now_ = ros_time_of(until).toSec();
  }
  if (!tf_frame_.empty()) follow_tf(by_stamp ? ros_time_of(until) : ros::Time());
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!poses_.has_come() || goes_on_from_) return std::nullopt;
  const double time = now();
  ToolRequest request;
  request.pose = interpolates_ ? poses_.at(time) : poses_.newest();
  if (jaws_.has_come()) request.jaw = interpolates_ ? jaws_.at(time) : jaws_.newest();
  request.placed = std::exchange(placed_, false);
  request.grip_pressure = grip_pressure_;
  return request;
}

bool ToolInput::has_next() {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  const WallTime now = WallClock::now();
  const bool jaws = tool_.type == ToolType::kGrasper && jaw_subscriber_.getNumPublishers() > 0;
  return held_poses_.first(now) && (!jaws || held_jaws_.first(now));
}

bool ToolInput::connected() const { return pose_subscriber_.getNumPublishers() > 0; }

std::optional<std::int64_t> ToolInput::first_held() {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  return held_poses_.first(WallClock::now());
}

bool ToolInput::awaited() const {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  return connected() && !came_since_;
}

void ToolInput::begin() {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  held_poses_.begin();
  held_jaws_.begin();
  late_ = 0;
}

void ToolInput::restart(const ros::Time& before, const ros::Time& now) {
  const std::lock_guard<std::mutex> held_lock(held_mutex_);
  held_poses_.restart(in_nanoseconds(before), in_nanoseconds(now));
  held_jaws_.restart(in_nanoseconds(before), in_nanoseconds(now));
  const std::lock_guard<std::mutex> lock(mutex_);
  came_since_ = held_poses_.first(WallClock::now()).has_value();
  check_.forget();
  goes_on_from_.reset();
  if (!pose_latched_) {
    poses_.forget();
  } else if (poses_.has_come()) {
    placed_ = came_since_ = true;
  }
  if (!jaw_latched_) jaws_.forget();
}

std::uint64_t ToolInput::late() const {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  return late_;
}

}  // namespace tissue_sim
