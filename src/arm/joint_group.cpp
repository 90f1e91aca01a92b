#include "arm/joint_group.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissue_sim {
namespace {

constexpr double kFollow = 4;  // measured follows the setpoint so many times as fast as moves are

// Share of the way at `time`, and its rate.
double share(const JointMove& move, double time, double* rate) {
  const double t = std::min(std::max(time, 0.0), move.duration);
  const double top = 1 / (move.duration - move.ramp);  // rate between the ramps
  const double left = move.duration - t;
  if (t < move.ramp) {
    *rate = top * t / move.ramp;
    return 0.5 * *rate * t;
  }
  if (left < move.ramp) {
    *rate = top * left / move.ramp;
    return 1 - 0.5 * *rate * left;
  }
  *rate = top;
  return top * (t - 0.5 * move.ramp);
}

}  // namespace

JointVector JointMove::position(double time) const {
  double rate = 0;
  return begin + share(*this, time, &rate) * way;
}

JointVector JointMove::velocity(double time) const {
  double rate = 0;
  share(*this, time, &rate);
  return rate * way;
}

JointMove make_move(const std::vector<JointLimits>& limits, const JointVector& begin,
                    const JointVector& end, double ratio) {
  JointMove move;
  move.begin = begin;
  move.way = end - begin;
  double speed = 1e9, acceleration = 1e9;  // of the share of the way
  for (int i = 0; i < move.way.size(); ++i) {
    const double length = std::max(std::fabs(move.way[i]), 1e-12);
    speed = std::min(speed, ratio * limits[i].velocity / length);
    acceleration = std::min(acceleration, ratio * limits[i].acceleration / length);
  }
  // Short ways never reach the top speed: their trapezoid is a triangle.
  speed = std::min(speed, std::sqrt(acceleration));
  move.ramp = speed / acceleration;
  move.duration = 1 / speed + move.ramp;
  if (move.duration < kShortestMove) {
    move.duration = kShortestMove;
    move.ramp = 0.5 * kShortestMove;
  }
  return move;
}

JointGroup::JointGroup(std::vector<JointLimits> limits, JointVector start)
    : limits_(std::move(limits)), setpoint_(start), measured_(start), end_(std::move(start)) {
  setpoint_velocity_ = measured_velocity_ = JointVector::Zero(setpoint_.size());
}

std::string JointGroup::refusal(const JointVector& goal) const {
  if (goal.size() != setpoint_.size()) {
    return std::to_string(goal.size()) + " positions came, there are " +
           std::to_string(setpoint_.size()) + " joints";
  }
  return outside_limits(limits_.data(), goal);
}

std::string JointGroup::servo(const JointVector& goal, const JointVector& velocity) {
  std::string why = refusal(goal);
  if (why.empty() && velocity.size() != 0 &&
      !(velocity.size() == goal.size() && velocity.allFinite())) {
    why = "its velocities are not as many as there are joints, or not finite";
  }
  if (!why.empty()) return why;
  queue_.clear();
  moving_ = false;
  setpoint_ = end_ = goal;
  if (velocity.size() != 0) {
    setpoint_velocity_ = velocity;
  } else {
    setpoint_velocity_.setZero();
  }
  return "";
}

std::string JointGroup::move(const JointVector& goal) {
  if (queue_.size() >= kLongestQueue) {
    return std::to_string(kLongestQueue) + " moves wait already";
  }
  const std::string why = refusal(goal);
  if (why.empty()) queue_.push_back(goal);
  return why;
}

void JointGroup::stay() {
  if (queue_.size() < kLongestQueue) queue_.push_back(JointVector(goal()));
}

void JointGroup::hold() {
  queue_.clear();
  moving_ = false;
  setpoint_ = end_ = measured_;
  setpoint_velocity_.setZero();
}

void JointGroup::advance(double seconds, double ratio) {
  if (!(seconds > 0)) return;
  if (!moving_ && !queue_.empty()) {
    move_ = make_move(limits_, setpoint_, queue_.front(), ratio);
    end_ = queue_.front();
    queue_.pop_front();
    moving_ = true;
    time_ = 0;
  }
  if (moving_) {
    time_ += seconds;
    setpoint_ = move_.position(time_);
    setpoint_velocity_ = move_.velocity(time_);
    if (time_ >= move_.duration) {
      setpoint_ = end_;
      setpoint_velocity_.setZero();
      moving_ = false;
    }
  }
  const JointVector before = measured_;
  for (int i = 0; i < measured_.size(); ++i) {
    const double step = kFollow * limits_[i].velocity * seconds;
    measured_[i] += std::min(std::max(setpoint_[i] - measured_[i], -step), step);
  }
  measured_velocity_ = (measured_ - before) / seconds;
}

}  // namespace tissue_sim
