// Points of tissue on a GPU that are stretched: they tear, or the fragment network looks at them.
// They are listed there; nodes come down where there are any, and what is said of them is said by
// the host. Pieces that fly take their shape at the end of each frame: substeps run without the
// host.
#include <algorithm>

#include "mpm/cuda/cuda_device.h"
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

std::vector<StretchedPoint> list_stretched(CudaTissue& d, float share) {
  d.stretched_count.resize(1);
  d.host_stretched_count.resize(1);
  d.stretched.resize(std::max<std::size_t>(d.stretched.size(), 4096));
  const auto look = [&] {
    const int room = static_cast<int>(d.stretched.size());
    launch_stretched(d.tables(), d.present(), d.plan.max_slots, share, d.stretched.data(), room,
                     d.stretched_count.data(), d.stream);
    d.stretched_count.download(d.host_stretched_count.data(), 1, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "look for tears");
    return d.host_stretched_count[0] <= room;
  };
  if (!look()) {
    d.stretched.resize(d.host_stretched_count[0]);
    look();
  }
  std::vector<StretchedPoint> stretched(d.host_stretched_count[0]);
  if (stretched.empty()) return stretched;
  d.stretched.download(stretched.data(), stretched.size(), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  std::sort(stretched.begin(), stretched.end(),
            [](const StretchedPoint& a, const StretchedPoint& b) { return a.point < b.point; });
  return stretched;
}

bool CudaMpmDevice::fly(double duration, Foresight& foresight,
                        std::vector<StrainedPoint>& strained) {
  CudaTissue& d = *tissue_;
  MpmState& s = d.state;
  strained = strained_by_threads(s, list_stretched(d, kRegionLevels[0]));
  const bool flights = may_fly(d.result, foresight);
  if (!strained.empty() || !s.flights.empty() || flights) pull_nodes(d);
  if (flights) pull_contacts(d);
  std::vector<std::int32_t> moved = fly_frame(s, duration, d.result.substeps);
  const std::vector<int> fly = let_fly(s, d.pieces, d.result, duration, foresight);
  for (const FragmentFlight& f : s.flights) {
    if (std::find(fly.begin(), fly.end(), f.piece) == fly.end()) continue;
    moved.insert(moved.end(), f.nodes.begin(), f.nodes.end());
  }
  if (moved.empty()) return false;
  push_some(d, moved);
  search_anew(d);
  return true;
}

}  // namespace tissue_sim
