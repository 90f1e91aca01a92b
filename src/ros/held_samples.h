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

  static constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();

  /// Returns whether an old one was dropped for it.
  bool add(std::int64_t stamp, T sample, WallTime now, std::int64_t clock) {
    if (!all_.empty() || taken_) {
      const std::int64_t before = all_.empty() ? newest_ : all_.back().stamp;
      if (stamp < before - kBack && !jump_) {
        jump_ = all_.size();
        jumped_at_ = now;
      }
    }
    all_.push_back({stamp, std::move(sample), clock});
    if (all_.size() <= kMost) return false;
    all_.pop_front();
    if (jump_ && *jump_ > 0) --*jump_;
    return true;
  }

  /// Calls use(stamp, sample, late) for each up to a stamp of `until`, or kAll; late ones should
  /// have been taken before.
  template <class Use>
  void take(std::int64_t until, WallTime now, const Use& use) {
    while (open(now) && all_.front().stamp <= until) {
      const Item item = pop();
      use(item.stamp, item.sample, item.stamp <= taken_until_);
    }
    if (until != kAll) taken_until_ = std::max(taken_until_, until);
  }
  /// The same for the oldest, whatever its stamp.
  template <class Use>
  void next(WallTime now, const Use& use) {
    if (!open(now)) return;
    const Item item = pop();
    use(item.stamp, item.sample, false);
  }
  /// The stamp of the oldest one.
  std::optional<std::int64_t> first(WallTime now) {
    if (!open(now)) return std::nullopt;
    return all_.front().stamp;
  }

  /// The clock has jumped back from `before` to `now`: forgets what came before it did.
  void restart(std::int64_t before, std::int64_t now) {
    if (jump_) {
      all_.erase(all_.begin(), all_.begin() + static_cast<std::ptrdiff_t>(*jump_));
    } else {
      // Half of the jump: another thread's clock may be some milliseconds ahead of `now`.
      const std::int64_t half = now + (before - now) / 2;
      while (!all_.empty() && all_.front().clock > half) all_.pop_front();
    }
    jump_.reset();
    taken_ = false;
    taken_until_ = std::numeric_limits<std::int64_t>::min();
  }
  /// A scene starts anew while time goes on: nothing is late before its first frame.
  void begin() { taken_until_ = std::numeric_limits<std::int64_t>::min(); }

 private:
  struct Item {
    std::int64_t stamp;
    T sample;
    std::int64_t clock;
  };

  bool open(WallTime now) {
    if (jump_ && *jump_ == 0 && now - jumped_at_ > kWait) jump_.reset();
    return !all_.empty() && !(jump_ && *jump_ == 0);
  }
  Item pop() {
    Item item = std::move(all_.front());
    all_.pop_front();
    newest_ = item.stamp;
    taken_ = true;
    if (jump_) --*jump_;
    return item;
  }

  std::deque<Item> all_;
  std::optional<std::size_t> jump_;  // the first one after it
  WallTime jumped_at_{};
  bool taken_ = false;       // any
  std::int64_t newest_ = 0;  // the last one taken [ns]
  std::int64_t taken_until_ = std::numeric_limits<std::int64_t>::min();
};

}  // namespace tissue_sim
