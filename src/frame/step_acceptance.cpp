#include "frame/step_acceptance.h"

#include <algorithm>

#include "frame/stability_limit.h"

namespace tissue_sim {
namespace {

constexpr double kBorne = 0.9;           // of the limit at the end of a part: else it is rejected,
constexpr double kMostShortened = 0.25;  // and substeps made shorter by that at most ...
constexpr double kLeastShortened = 0.7;  // ... and by that at least, ...
constexpr double kShortest = 1e-3;       // ... until by that: then it is no use
constexpr double kMostGain = 1.03;       // a part that grows the energy by more than was given is
constexpr double kHalf = 0.5;            // rejected, and done again with substeps half as long

}  // namespace

bool StepAcceptance::accepts(double dt, double limit, const PartEnergy& energy, bool watched,
                             const std::function<double()>& by_gravity) {
  const double now = energy.kinetic + energy.elastic;
  const double explained = kMostGain * energy_ + std::max(0.0, energy.given);
  const bool grew = watched && now > explained && now > explained + by_gravity();
  if ((dt <= kBorne * limit && !grew) || shortened_ < kShortest) {
    energy_ = now;
    return true;
  }
  const double wanted = std::min(kStabilityMargin * limit / dt, grew ? kHalf : 1.0);
  shortened_ *= wanted > kMostShortened ? std::min(wanted, kLeastShortened) : kMostShortened;
  return false;
}

}  // namespace tissue_sim
