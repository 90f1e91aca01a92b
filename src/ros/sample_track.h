// SampleTrack: the way between the samples of an arm that is slower than the frames.
#pragma once

#include <algorithm>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// The share `s` (0 to 1) of the way from a to b.
inline double between(double a, double b, double s) { return a + s * (b - a); }
inline Pose between(const Pose& a, const Pose& b, double s) {
  return {(1 - s) * a.position + s * b.position, a.orientation.slerp(s, b.orientation)};
}

/// Goes straight from where it is to the newest sample, in the time that passed between the last
/// two: it arrives when the next one is due, one sample later than the arm. Where samples come late
/// it stays. Times [s] by a clock that never goes back.
template <class T>
class SampleTrack {
 public:
  /// It is there at once.
  void place(const T& value, double now) {
    from_ = to_ = value;
    came_ = now;
    duration_ = 0;
    has_come_ = true;
  }
  /// The first one places it.
  void add(const T& value, double now) {
    if (!has_come()) return place(value, now);
    from_ = at(now);
    to_ = value;
    duration_ = std::min(now - came_, kLongest);
    came_ = now;
  }
  bool has_come() const { return has_come_; }
  void forget() { has_come_ = false; }
  const T& newest() const { return to_; }
  T at(double now) const {
    const double passed = now - came_;
    return passed >= duration_ ? to_ : between(from_, to_, passed / duration_);
  }

 private:
  static constexpr double kLongest = 0.5;  // what is slower than this is no arm that moves [s]
  T from_{}, to_{};
  bool has_come_ = false;
  double came_ = 0, duration_ = 0;  // [s]
};

}  // namespace tissue_sim
