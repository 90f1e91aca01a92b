// Samples of a topic that wait for the frame that they are for.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

#include "ros/pace.h"

namespace tissue_sim {

/// Which samples a frame takes: those stamped up to a time [ns], all, or the oldest one whatever
/// its stamp.
constexpr std::int64_t kTakeAll = std::numeric_limits<std::int64_t>::max();
constexpr std::int64_t kTakeNext = std::numeric_limits<std::int64_t>::min();
inline bool is_stamp(std::int64_t until) { return until != kTakeAll && until != kTakeNext; }

/// In the order in which they came. A stamp that goes back by more than a second is of a time that
/// has jumped back, which the clock's own message may say only later: what comes from there on is
/// not taken before restart(), or the arm's own clock was set back and nobody restarts anything.
/// What the clock said as each came (`clock`, ns) tells which came before a jump of the clock.
template <class T>
class HeldSamples {
 public:
  static constexpr std::int64_t kBack = 1000000000;           ///< [ns]
  static constexpr std::chrono::seconds kWait{3};             ///< for restart(), wall time
  static constexpr std::size_t kMost = std::size_t(1) << 17;  ///< of them; the oldest are dropped

  /// Returns whether an old one was dropped for it.
  bool add(std::int64_t stamp, T&& sample, WallTime now, std::int64_t clock) {
    const std::int64_t before = all_.empty() ? newest_ : all_.back().stamp;
    if (stamp < before - kBack && !jump_) {
      jump_ = all_.size();
      jumped_at_ = now;
    }
    all_.push_back({stamp, std::move(sample), clock});
    const bool drops = all_.size() > kMost;
    if (drops) pop();
    return drops;
  }

  /// Calls use(stamp, sample, late) for those up to `until`; late ones should have been taken
  /// before.
  template <class Use>
  void take(std::int64_t until, WallTime now, const Use& use) {
    const auto is_due = [&] { return until == kTakeNext || all_.front().stamp <= until; };
    for (bool more = true; more && first(now) && is_due(); more = until != kTakeNext) {
      const Item& item = all_.front();
      newest_ = item.stamp;
      use(item.stamp, item.sample, until != kTakeNext && item.stamp <= taken_until_);
      pop();
    }
    if (is_stamp(until)) taken_until_ = std::max(taken_until_, until);
  }
  /// The stamp of the oldest one.
  std::optional<std::int64_t> first(WallTime now) {
    if (jump_ && *jump_ == 0 && now - jumped_at_ > kWait) jump_.reset();
    if (all_.empty() || (jump_ && *jump_ == 0)) return std::nullopt;
    return all_.front().stamp;
  }

  /// The clock has jumped back from `before` to `now`: forgets what came before it did.
  void restart(std::int64_t before, std::int64_t now) {
    // Half of the jump: another thread's clock may be some milliseconds ahead of `now`.
    const std::int64_t half = now + (before - now) / 2;
    const bool knows = jump_.has_value();
    while (knows ? *jump_ > 0 : !all_.empty() && all_.front().clock > half) pop();
    jump_.reset();
    newest_ = kNone;
    begin();
  }
  /// A scene starts anew while time goes on: nothing is late before its first frame.
  void begin() { taken_until_ = kNone; }

 private:
  static constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::min() + kBack;
  struct Item {
    std::int64_t stamp;
    T sample;
    std::int64_t clock;
  };

  void pop() {
    all_.pop_front();
    if (jump_ && *jump_ > 0) --*jump_;
  }

  std::deque<Item> all_;
  std::optional<std::size_t> jump_;  // the first one after it
  WallTime jumped_at_{};
  std::int64_t newest_ = kNone;  // the last one taken [ns]
  std::int64_t taken_until_ = kNone;
};

}  // namespace tissue_sim
