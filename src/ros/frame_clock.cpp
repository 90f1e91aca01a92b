#include "ros/frame_clock.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "ros/stamps.h"

namespace tissue_sim {
namespace {

constexpr std::int64_t kSecond = 1000000000;   // [ns]
constexpr std::int64_t kStale = kSecond;       // poses that much older than the clock are kept ones
constexpr std::int64_t kAhead = 10 * kSecond;  // no clock goes, and no pose is, so far ahead
constexpr std::chrono::milliseconds kIdle(200);  // between two looks at a simulation at rest

WallClock::duration wall_duration(double s) {
  return std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(s));
}

}  // namespace

FrameClock::FrameClock(const Parameters& parameters) : parameters_(parameters) {
  if (own_clock()) own_ = ros::TIME_MIN + ros::Duration(1);  // 0 stands for no time
}

std::int64_t FrameClock::delay() const {
  return static_cast<std::int64_t>(std::llround(parameters_.pose_delay * 1e9));
}

void FrameClock::restart(double frame_rate) {
  frame_rate_ = frame_rate;
  pace_ = Pace(frame_rate * std::max(parameters_.time_factor, 1e-3));
  pace_.restart(WallClock::now());
  schedule_ = RosSchedule(frame_rate);
  first_time_.reset();
}

void FrameClock::resume() {
  pace_.restart(WallClock::now());
  if (schedule_.begun()) schedule_.move(in_nanoseconds(ros_time()));
}

void FrameClock::set_ros_time(const ros::Time& now) {
  const double step = seconds_between(ros_time_, now);
  if (parameters_.time == TimeMode::kRos && !ros_time_.isZero() && step * kSecond > kAhead &&
      schedule_.begun()) {
    ROS_WARN("/clock jumped ahead by %.1f s: the simulation goes on from there", step);
    schedule_.move(in_nanoseconds(now));
  }
  ros_time_ = now;
}

ros::Time FrameClock::ros_time() const {
  return ros::Time::isSimTime() && !own_clock() ? ros_time_ : ros::Time::now();
}

ros::Time FrameClock::stamp() const {
  if (own_clock()) return own_;
  return parameters_.time == TimeMode::kRos ? ros_time() : ros::Time::now();
}

double FrameClock::behind() const {
  if (parameters_.time != TimeMode::kRos || !schedule_.begun()) return 0;
  return std::max(0.0, (in_nanoseconds(ros_time()) - schedule_.due()) * 1e-9);
}

bool FrameClock::ros_due(const ToolInputs& tools) {
  const ros::Time time = ros_time();
  if (time.isZero()) return false;
  if (!first_time_) first_time_ = time;
  const std::int64_t now = in_nanoseconds(time), begin = in_nanoseconds(*first_time_);
  if (!schedule_.begun()) {
    // The first pose's stamp decides when frame 0 is, not when somebody happened to look: so the
    // same poses meet the same frames at every rate at which a bag is played.
    std::optional<std::int64_t> first;
    bool awaited = false;
    for (const auto& tool : tools) {
      const ToolInput::Held held = tool->held();
      if (held.first && *held.first > begin - kStale && *held.first < now + kAhead) {
        first = std::min(first.value_or(*held.first), *held.first);
      } else {
        awaited = awaited || (!held.first && held.awaited);
      }
    }
    if (!first && awaited) return false;
    schedule_.start(first ? *first + delay() : begin);
  }
  return now >= schedule_.due();
}

bool FrameClock::all_sampled(const ToolInputs& tools) const {
  const auto& named = parameters_.lockstep_tools;
  bool any = false;
  for (const auto& tool : tools) {
    const ToolInput::Held held = tool->held();
    const bool wanted = named.empty()
                            ? held.connected || held.has_next
                            : std::find(named.begin(), named.end(), tool->tool()) != named.end();
    if (!wanted) continue;
    if (!held.has_next) return false;
    any = true;
  }
  return any;
}

bool FrameClock::due(const ToolInputs& tools) {
  if (parameters_.time == TimeMode::kRos) return ros_due(tools);
  if (parameters_.time_factor > 0 && WallClock::now() < pace_.due()) return false;
  return parameters_.time == TimeMode::kWall || all_sampled(tools);
}

WallTime FrameClock::wake() const {
  const WallTime now = WallClock::now();
  if (parameters_.time == TimeMode::kRos) {
    if (ros::Time::isSimTime()) return now + kIdle;  // /clock wakes
    const double left = (schedule_.due() - in_nanoseconds(ros::Time::now())) * 1e-9;
    return now + std::min<WallClock::duration>(kIdle, wall_duration(std::max(left, 0.0)));
  }
  if (parameters_.time == TimeMode::kLockstep && pace_.due() <= now) return now + kIdle;
  return std::min<WallTime>(pace_.due(), now + std::chrono::seconds(1));
}

std::int64_t FrameClock::begin_frame(bool in_turn, bool paused) {
  pace_.begin_frame(WallClock::now());
  frame_stamp_ = stamp();
  if (parameters_.time == TimeMode::kLockstep && !paused) return kTakeNext;
  if (parameters_.time != TimeMode::kRos || !in_turn) return kTakeAll;
  const std::int64_t due = schedule_.due();
  schedule_.next();
  frame_stamp_ = ros_time_of(due);
  return in_nanoseconds(ros_time_of(due - delay()));
}

FrameTime FrameClock::end_frame() {
  elapsed_ += 1 / frame_rate_;
  if (own_clock()) {
    // Rounded as by ros::Rate: a client that sleeps for as long must wake when the frame is done.
    own_ += ros::Duration(1 / frame_rate_);
    return {own_, elapsed_};
  }
  const bool by_wall = parameters_.time == TimeMode::kWall && parameters_.time_factor == 1;
  return {parameters_.time == TimeMode::kRos ? frame_stamp_ : ros::Time::now(),
          by_wall ? seconds(WallClock::now()) : elapsed_};
}

}  // namespace tissue_sim
