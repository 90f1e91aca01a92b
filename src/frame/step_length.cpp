#include "frame/step_length.h"

#include <algorithm>
#include <utility>

namespace tissue_sim {
namespace {

constexpr double kCalmTrend = 1.2;  // of the stiffness in a part: the next one is longer ...
constexpr double kMostTrend = 1.3;  // ... or shorter
constexpr double kSwing = 0.06;     // [s]; where nothing damps substeps are as short as the
constexpr double kLonger = 1.1;     // shortest of one or two, until all are longer by that
constexpr double kMostAbove = 1.1;  // the first substep over what all should come to: that, or
                                    // what the trend, which is not there yet, takes from it

}  // namespace

void StepLength::follow(double passed, double trend, double frame) {
  if (passed > 0) {
    part_ = trend > kMostTrend ? passed / 2 : trend < kCalmTrend ? 2 * passed : passed;
  }
  part_ = std::min(part_, frame);
}

double StepLength::choose(double time, double predicted, double trend, bool at_once,
                          bool undamped) {
  const double chosen = !at_once && undamped ? held(time, predicted) : predicted;
  most_ = at_once ? 0 : std::max(kMostAbove, std::sqrt(trend)) * chosen;
  return chosen;
}

double StepLength::held(double time, double predicted) {
  if (time >= swing_end_) {
    of_last_swing_ = std::exchange(of_swing_, INFINITY);
    swing_end_ = time + kSwing;
  }
  of_swing_ = std::min(of_swing_, predicted);
  const double shortest = std::min(of_swing_, of_last_swing_);
  if (shortest < held_ || shortest > kLonger * held_) held_ = shortest;
  return held_;
}

PartSubsteps StepLength::part(double time, double longest, double before, double most) const {
  PartSubsteps part = substeps_for(time, longest, before, most_);
  const double wanted = std::min(part_, most);
  const int count = std::max(kShortestPart, static_cast<int>(wanted / part.last + 0.5));
  const int parts = (part.count + count - 1) / count;
  part.count = (part.count + parts - 1) / parts;
  return part;
}

}  // namespace tissue_sim
