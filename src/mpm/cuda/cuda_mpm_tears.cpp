// Tears of tissue that lives on a GPU: found there every few substeps; bonds break on the host, and
// what follows is that of cuts.
#include <algorithm>

#include "mpm/cuda/on_device.h"
#include "mpm/split/cut_tissue.h"
#include "mpm/tear/bond_bridges.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

void CudaMpmTissue::keep_place_for_blades() {
  if (blades_.empty()) return;
  OnDevice& d = *device_;
  d.u_before.resize(d.u[0].size());
  check_cuda(cudaMemcpyAsync(d.u_before.data(), d.present().u, d.u[0].size() * sizeof(float4),
                             cudaMemcpyDeviceToDevice, d.stream),
             "copy");
}

std::vector<StretchedPoint> CudaMpmTissue::list_stretched(float share) {
  OnDevice& d = *device_;
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

std::vector<TearingPoint> CudaMpmTissue::find_tearing() {
  std::vector<TearingPoint> tearing;
  add_tearing(*state_, list_stretched(1), tearing);
  return tearing;
}

bool CudaMpmTissue::tear(double share) {
  MpmState& s = *state_;
  const bool bridges =
      share < 1 && may_be_wild(s) && !s.bridge_ends.empty();  // at 1, finish() does
  if (tearing_.empty() && !bridges) return false;
  const bool blades = !blades_.empty();
  if (blades) {  // what they have passed so far
    launch_measure();
    finish_measure();
    blades_ = blade_paths(state_->scene, input_, cut_to_, share);
    cut_by_blades();
  }
  std::vector<std::int32_t> changed;
  tear_bonds(s, tearing_, changed, result_.tear_report);
  if (bridges) {
    pull_some(nodes_around(s.bridge_ends));
    tear_bridges(s, changed, result_.tear_report);
  }
  if (changed.empty() && !blades) return false;
  if (!changed.empty()) take_apart(changed);
  launch_measure();
  finish_measure();
  if (blades) {
    blades_ = blade_paths(state_->scene, input_, share, 1);
    cut_to_ = share;
    motion_before_ = state_->motion;
    keep_place_for_blades();
  }
  return true;
}

bool CudaMpmTissue::settle_wild_debris() {
  MpmState& s = *state_;
  if (s.debris.empty() || !may_be_wild(s)) return false;
  const std::vector<std::int32_t> nodes = nodes_around({s.debris.begin(), s.debris.end()});
  pull_some(nodes);
  if (tissue_sim::settle_wild_debris(s, s.debris).empty()) {
    return false;
  }
  push_some(nodes);
  return true;
}

void CudaMpmTissue::tame() {
  if (result_.blew_up || !may_be_wild(*state_)) return;
  MpmState& s = *state_;
  const bool settled = settle_wild_debris();
  std::vector<std::int32_t> changed;
  if (!s.bridge_ends.empty()) {
    pull_some(nodes_around(s.bridge_ends));
    tear_bridges(s, changed, result_.tear_report);
  }
  if (!settled && changed.empty()) return;
  if (!changed.empty()) {
    take_apart(changed);
    for (const int id : label_pieces()) result_.tear_report.new_fragments.push_back(id);
  }
  launch_measure();
  finish_measure();
  substep_.follow(s, modulus_);
}

}  // namespace tissue_sim
