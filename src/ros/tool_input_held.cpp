// Samples of an instrument that wait for the frame that they are for: by stamp or one by one.
#include <ros/console.h>

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

void ToolInput::hold(Held& held, const ros::Time& stamp, std::function<void()> accept) {
  if (has_wrong_stamp(stamp, &held == &held_poses_)) return;  // one such would hold all up
  if (!on_sample_) {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    accept();
    return;
  }
  bool dropped = false;
  {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    const ros::Time time = stamp.isZero() ? ros::Time::now() : stamp;
    dropped = held.add(in_nanoseconds(time), std::move(accept), WallClock::now(),
                       in_nanoseconds(ros::Time::now()));
    late_ += dropped;
    came_since_ = came_since_ || &held == &held_poses_;
  }
  if (dropped) {
    ROS_WARN_ONCE("%s: samples are lost, for they come faster than frames take them",
                  tool().c_str());
  }
  on_sample_();
}

void ToolInput::release(std::int64_t until) {
  if (!on_sample_) return;
  const std::lock_guard<std::mutex> lock(held_mutex_);
  const WallTime now = WallClock::now();
  for (Held* held : {&held_jaws_, &held_poses_}) {
    held->take(until, now, [&](std::int64_t stamp, const auto& accept, bool late) {
      late_ += late;
      held_now_ = stamp * 1e-9;
      accept();
    });
  }
}

std::optional<ToolRequest> ToolInput::take_until(const ros::Time& until) {
  release(in_nanoseconds(until));
  held_now_ = until.toSec();
  return take_released(until);
}

std::optional<ToolRequest> ToolInput::take_next() {
  {
    const std::lock_guard<std::mutex> lock(held_mutex_);
    const WallTime now = WallClock::now();
    for (Held* held : {&held_jaws_, &held_poses_}) {
      const auto sample = held->next(now);
      if (!sample) continue;
      held_now_ = sample->first * 1e-9;
      sample->second();
    }
  }
  return take_released(ros::Time());
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
  if (!pose_latched_) {
    sample_.reset();
  } else if (sample_) {
    sample_->placed = came_since_ = true;
  }
  if (jaw_latched_) return;
  jaw_came_ = false;
  jaw_ = 0;
}

std::uint64_t ToolInput::late() const {
  const std::lock_guard<std::mutex> lock(held_mutex_);
  return late_;
}

}  // namespace tissue_sim
