// The lengths of the substeps of a part of a frame.
#pragma once

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace tissue_sim {

/// Substeps whose length changes little by little, until it is `last`. A length that jumps by a
/// tenth and more, as it may with each part, heats what swings fastest: the energy that leapfrog
/// keeps exactly is not that of the motion, but off by a share that grows with the square of the
/// substep, and a jump turns the difference into motion. Changes that take several periods do not.
struct PartSubsteps {
  int count = 0;
  double first = 0, last = 0;  ///< [s]
  double factor = 1;           ///< from one to the next, ...
  int changing = 0;            ///< ... for so many; those after them are as long as the last

  /// Length of the substep `i` [s].
  float at(int i) const {
    return static_cast<float>(i < changing ? first * std::pow(factor, i) : last);
  }
  /// How long the first `n` take [s].
  double until(int n) const {
    const int changed = std::min(n, changing);
    const double sum = changed == 0 ? 0 : first * (std::pow(factor, changed) - 1) / (factor - 1);
    return sum + (n - changed) * last;
  }
  /// The share of a frame after the first `n`, if they all lead from one share to another.
  double share(int n, double from, double to) const {
    return from + (to - from) * (until(n) / until(count));
  }
  /// From `i` on all have one length.
  bool is_even_from(int i) const { return i >= changing; }
  float longest() const { return std::max(at(0), at(count - 1)); }
};

constexpr double kMostSubstepsOfFrame = 1e5;  ///< of tissue at rest
/// Crushed tissue may take more for a frame or two. What none can take any more is a frame that
/// never ends.
constexpr double kMostSubstepsAtAll = 2e6;

/// Throws std::runtime_error where `time` takes more than kMostSubstepsAtAll of `longest` [s].
inline void check_substeps(double time, double longest) {
  if (!(longest > 0) || time / longest <= kMostSubstepsAtAll) return;
  throw std::runtime_error("a frame takes " + std::to_string(std::llround(time / longest)) +
                           " substeps, at most 2000000 are done: raise frame_rate or cell_size, or "
                           "lower viscosity or young_modulus of the materials");
}

/// `count` substeps of `dt` seconds.
inline PartSubsteps even_substeps(int count, double dt) { return {count, dt, dt, 1, 0}; }

/// As few as take `time`, none longer than `longest` but where they follow one of `before` (0:
/// none) that was; then the first has at most `most` [s].
inline PartSubsteps substeps_for(double time, double longest, double before, double most) {
  constexpr double kChange = 1.05;
  if (!(longest > 0)) return even_substeps(1, time);  // it blew up
  check_substeps(time, longest);
  PartSubsteps s = even_substeps(0, longest);
  if (before > 0) {
    const double up = before * kChange, down = std::min(before / kChange, std::max(most, longest));
    s.first = std::min(up, std::max(down, longest));
    s.factor = longest > s.first ? kChange : 1 / kChange;
    s.changing = static_cast<int>(std::ceil(std::log(longest / s.first) / std::log(s.factor)));
  }
  const double even = std::ceil((time - s.until(s.changing)) / longest);
  s.count = s.changing + std::max(0, static_cast<int>(even));
  while (s.count > 1 && s.until(s.count - 1) >= time) --s.count;
  const double scale = time / s.until(s.count);
  s.first *= scale;
  s.last *= scale;
  return s;
}

}  // namespace tissue_sim
