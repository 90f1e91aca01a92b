// Frames against the wall clock.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

namespace tissue_sim {

using WallClock = std::chrono::steady_clock;
using WallTime = WallClock::time_point;

inline double seconds(WallTime t) {
  return std::chrono::duration<double>(t.time_since_epoch()).count();
}

/// When each frame is due: frame n at start + n * period. Where the simulation is late by more than
/// a frame it drops behind, and the schedule starts anew from there: no burst ever catches up.
class Pace {
 public:
  explicit Pace(double frame_rate)
      : period_(std::chrono::duration_cast<WallClock::duration>(
            std::chrono::duration<double>(1.0 / frame_rate))) {}

  void restart(WallTime now) { due_ = now; }
  WallTime due() const { return due_; }
  /// The frame that was due begins now; the next is due a period later.
  void begin_frame(WallTime now) {
    if (now - due_ > period_) due_ = now;
    due_ += period_;
  }

 private:
  WallClock::duration period_;
  WallTime due_{};
};

/// Simulated over wall time, over about the last second.
class RealTimeFactor {
 public:
  void restart() { samples_.clear(); }
  void add(WallTime now, double simulated) {
    samples_.push_back({now, simulated});
    while (samples_.size() > 2 && now - samples_[1].wall >= std::chrono::seconds(1)) {
      samples_.pop_front();
    }
  }
  /// 0 until two frames are done.
  double value() const {
    if (samples_.size() < 2) return 0;
    const Sample &a = samples_.front(), &b = samples_.back();
    const double wall = std::chrono::duration<double>(b.wall - a.wall).count();
    return wall > 0 ? (b.simulated - a.simulated) / wall : 0;
  }

 private:
  struct Sample {
    WallTime wall;
    double simulated;  // [s]
  };
  std::deque<Sample> samples_;
};

/// Lets through about `rate` frames a second, as evenly as whole frames allow.
class Throttle {
 public:
  /// A rate of 0 or of at least the frame rate lets every frame through.
  Throttle(double rate, double frame_rate)
      : all_(rate <= 0 || rate >= frame_rate * 0.999),
        period_(1.0 / (all_ ? frame_rate : rate)),
        slack_(0.5 / frame_rate) {}

  /// `t` is by whatever clock the rate is of; one that goes back starts anew [s].
  bool due(double t) {
    if (all_) return true;
    if (t + 2 * period_ < next_) next_ = t;
    if (t + slack_ < next_) return false;
    next_ = t > next_ + period_ ? t + period_ : next_ + period_;
    return true;
  }

 private:
  bool all_;
  double period_, slack_;  // [s]
  double next_ = 0;        // [s]
};

}  // namespace tissue_sim
