// FrameClock: when a frame is due, up to when its poses count, and the time of its messages.
#pragma once

#include <ros/time.h>

#include <cstdint>
#include <optional>

#include "ros/pace.h"
#include "ros/parameters.h"
#include "ros/publications.h"
#include "ros/tool_input.h"

namespace tissue_sim {

/// Frames against ROS time: frame n is due at start + n / frame_rate, exactly, so that they lie the
/// same whenever the clock was looked at.
class RosSchedule {
 public:
  explicit RosSchedule(double frame_rate) : frame_rate_(frame_rate) {}

  bool begun() const { return frame_ > 0; }
  void start(std::int64_t time) { start_ = time; }  ///< [ns]; as often as before the first frame
  /// The frame that is due next, from now on at `time`.
  void move(std::int64_t time) { start_ = time - offset(); }
  std::int64_t due() const { return start_ + offset(); }  ///< of the next frame [ns]
  void next() { ++frame_; }

 private:
  std::int64_t offset() const {
    return static_cast<std::int64_t>(static_cast<long double>(frame_) * 1e9L / frame_rate_ + 0.5L);
  }
  double frame_rate_;
  std::int64_t start_ = 0, frame_ = 0;
};

/// Of the simulation's thread alone.
class FrameClock {
 public:
  explicit FrameClock(const Parameters& parameters);

  /// A scene starts at its frame 0.
  void restart(double frame_rate);
  /// After a pause: what went by meanwhile is not made up for.
  void resume();
  /// What /clock says; only if it is not this node that says it.
  void set_ros_time(const ros::Time& now);
  ros::Time ros_time() const;

  /// Whether the next frame is due.
  bool due(const ToolInputs& tools);
  /// When to look again if nothing wakes the thread before.
  WallTime wake() const;
  /// A frame begins; `in_turn` if because it was due, else because somebody stepped or cut. Which
  /// of the instruments' samples are for it: see ToolInput::ask().
  std::int64_t begin_frame(bool in_turn, bool paused);
  /// The frame is done.
  FrameTime end_frame();
  /// Of messages between frames.
  ros::Time stamp() const;
  /// How far the next frame is behind the ROS time that it is due at [s].
  double behind() const;

 private:
  bool ros_due(const ToolInputs& tools);
  bool all_sampled(const ToolInputs& tools) const;
  std::int64_t delay() const;
  bool own_clock() const { return parameters_.publish_clock; }

  const Parameters parameters_;
  double frame_rate_ = 60;
  Pace pace_{60};
  RosSchedule schedule_{60};
  std::optional<ros::Time> first_time_;  // that was seen since the restart
  ros::Time ros_time_;
  ros::Time own_;  // of the clock that this node is
  ros::Time frame_stamp_;
  double elapsed_ = 0;  // simulated over all scenes [s]
};

}  // namespace tissue_sim
