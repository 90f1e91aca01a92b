// ROS_WARN_THROTTLE by the wall's clock.
#pragma once

#include <ros/console.h>

#include <atomic>

#include "ros/pace.h"

namespace tissue_sim {

/// Thread-safe.
class Seldom {
 public:
  explicit Seldom(double period)
      : period_(std::chrono::duration_cast<WallClock::duration>(
            std::chrono::duration<double>(period))) {}

  /// True the first time, and then not again before `period` seconds have passed.
  bool due(WallTime now) {
    const WallClock::rep time = now.time_since_epoch().count();
    WallClock::rep next = next_;
    return time >= next && next_.compare_exchange_strong(next, time + period_.count());
  }

 private:
  const WallClock::duration period_;
  std::atomic<WallClock::rep> next_{0};
};

}  // namespace tissue_sim

/// ROS_WARN, at each place at most once in `period` seconds of wall time. ROS_WARN_THROTTLE goes by
/// /clock: it says nothing in that clock's first seconds, nor while it stands still.
#define WARN_SELDOM(period, ...)                                         \
  do {                                                                   \
    static tissue_sim::Seldom seldom(period);                            \
    if (seldom.due(tissue_sim::WallClock::now())) ROS_WARN(__VA_ARGS__); \
  } while (false)
