// The fragment network of tissue that lives on a GPU: strained points are listed there, nodes come
// down where there are any, and what is said of them is said by the host. Pieces that fly take
// their shape at the end of each frame: substeps run without the host.
#include <algorithm>

#include "mpm/cuda/on_device.h"
#include "mpm/fragment_flight.h"
#include "mpm/fragment_forecast.h"

namespace tissue_sim {
namespace {

/// strained_of() by all threads. `stretched`: by number.
std::vector<StrainedPoint> strained_by_threads(const MpmState& s,
                                               const std::vector<StretchedPoint>& stretched) {
  constexpr int kShare = 256;
  const int count = static_cast<int>(stretched.size()), shares = (count + kShare - 1) / kShare;
  std::vector<std::vector<StrainedPoint>> of_share(shares);
  s.cpu->for_each(shares, [&](int i) {
    const auto first = stretched.begin() + i * kShare;
    of_share[i] = strained_of(s, {first, stretched.begin() + std::min(count, (i + 1) * kShare)},
                              kRegionLevels[0]);
  });
  std::vector<StrainedPoint> strained;
  for (const auto& part : of_share) strained.insert(strained.end(), part.begin(), part.end());
  return strained;
}

}  // namespace

void CudaMpmTissue::foresee() {
  MpmState& s = *state_;
  std::vector<StrainedPoint> strained = strained_by_threads(s, list_stretched(kRegionLevels[0]));
  const bool flights = may_fly(result_, foresight_);
  if (!strained.empty() || !s.flights.empty() || flights) pull_nodes();
  if (flights) pull_contacts();
  std::vector<std::int32_t> moved = fly_frame(s, duration_, result_.substeps);
  const std::vector<int> fly = let_fly(s, pieces_, result_, duration_, foresight_);
  for (const FragmentFlight& f : s.flights) {
    if (std::find(fly.begin(), fly.end(), f.piece) == fly.end()) continue;
    moved.insert(moved.end(), f.nodes.begin(), f.nodes.end());
  }
  if (!moved.empty()) {
    push_some(moved);
    search_anew();
    launch_measure();
    finish_measure();
    substep_.follow(s, modulus_);
  }
  look_ahead(s, pieces_, std::move(strained), duration_, foresight_, result_);
}

}  // namespace tissue_sim
