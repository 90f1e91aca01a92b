// Joints that are commanded together, the arm's six or the jaw's one: what is asked of them (the
// setpoint) and where they are (measured). There is no dynamics: they follow at a limited speed.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "arm/kinematics.h"

namespace tissue_sim {

/// From rest to rest on a straight line in joint space: a trapezoid of speed, all joints at once,
/// as fast as the slowest of them.
struct JointMove {
  JointVector begin, way;  ///< [rad] or [m]
  double ramp = 0;         ///< of speeding up, and of slowing down [s]
  double duration = 0;     ///< [s]

  JointVector position(double time) const;
  JointVector velocity(double time) const;
};

/// `ratio` (above 0, to 1) of the limits' velocities and accelerations. No shorter than
/// kShortestMove: who waits for its end must see that it began.
JointMove make_move(const std::vector<JointLimits>& limits, const JointVector& begin,
                    const JointVector& end, double ratio);
constexpr double kShortestMove = 0.05;  ///< [s]

class JointGroup {
 public:
  JointGroup(std::vector<JointLimits> limits, JointVector start);

  /// At once, in place of all that was asked for. Returns "", or why it is refused: then nothing
  /// changes. `velocity` may be empty: it is what the setpoint's velocity is said to be.
  std::string servo(const JointVector& goal, const JointVector& velocity = {});
  /// After those that were asked for before it, at most kLongestQueue of them.
  std::string move(const JointVector& goal);
  /// A move to where the last one ends: so that who waits for one that was refused does not for
  /// ever.
  void stay();
  /// Drops what was asked for; the setpoint is where they are.
  void hold();

  /// `seconds` later; moves that begin in them have `ratio` of the limits' speeds.
  void advance(double seconds, double ratio);

  bool busy() const { return !queue_.empty() || moving_; }
  /// Where the last move that was asked for ends; else the setpoint.
  const JointVector& goal() const { return queue_.empty() ? end_ : queue_.back(); }
  const JointVector& setpoint() const { return setpoint_; }
  const JointVector& setpoint_velocity() const { return setpoint_velocity_; }
  const JointVector& measured() const { return measured_; }
  const JointVector& measured_velocity() const { return measured_velocity_; }
  const std::vector<JointLimits>& limits() const { return limits_; }

  static constexpr std::size_t kLongestQueue = 32;

 private:
  std::string refusal(const JointVector& goal) const;

  std::vector<JointLimits> limits_;
  JointVector setpoint_, setpoint_velocity_, measured_, measured_velocity_;
  JointVector end_;  // of the move that goes on, else the setpoint
  std::deque<JointVector> queue_;
  JointMove move_;
  double time_ = 0;  // since the move began
  bool moving_ = false;
};

}  // namespace tissue_sim
