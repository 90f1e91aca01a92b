// Which tissue on a GPU instruments and the ground may meet in a part of a frame.
#include <algorithm>

#include "mpm/cuda/on_device.h"

namespace tissue_sim {

namespace {

constexpr double kSurfaceReach = 0.5;  // from the points of a cell to its surface, at most [cells]

/// Whether any of these may be within its margin of what a collider sweeps.
template <class Margin>
bool may_meet(const CudaTissue& d, const std::vector<BlockMotion>& motion, const Margin& margin) {
  const auto meets = [](const BlockMotion& m, double far, const CudaBox& reach) {
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      meets = meets && m.box.min[a] - far <= reach.max[a] && reach.min[a] <= m.box.max[a] + far;
    }
    return meets;
  };
  return std::any_of(motion.begin(), motion.end(), [&](const BlockMotion& m) {
    const double far = margin(m);
    return std::any_of(d.host_reach.data(), d.host_reach.data() + d.host_reach.size(),
                       [&](const CudaBox& reach) { return meets(m, far, reach); });
  });
}

CudaReach reach(const CudaTissue& d) {
  CudaReach reach{d.reach.data(),
                  static_cast<int>(d.host_reach.size()),
                  0,
                  static_cast<float>(d.run.frame->duration),
                  static_cast<float>((0.5 + kSurfaceReach) * d.state.scene.cell_size),
                  d.went.empty() ? nullptr : d.u_went.data()};
  for (int c = 0; c < reach.collider_count; ++c) {
    if (d.host_colliders[c].kind == Collider::kBlade) reach.blades |= 1u << c;
  }
  return reach;
}

}  // namespace

void find_near(CudaTissue& d) {
  // A little more than the GPU finds, for what it finds must be done.
  const double cell = (1 + kSurfaceReach) * d.state.scene.cell_size;
  d.may_meet =
      may_meet(d, d.state.motion,
               [&](const BlockMotion& m) { return m.speed * d.run.frame->duration + cell; }) ||
      may_meet(d, d.went, [&](const BlockMotion&) { return cell; });
  if (!d.may_meet) {
    d.with.clear(d.stream);
    return;
  }
  const std::size_t cells = d.of_blocks.partial.size();
  d.near_cells.resize(cells);
  d.near_listed.resize(cells);
  d.near_count.resize(1);
  launch_near(d.tables(), d.present(), d.measures.data(), reach(d),
              {d.near_cells.data(), d.near_count.data(), d.near_listed.data(), cells,
               d.marks.data(), d.marks.size(), d.pushed_parts.data(), d.pushed_parts.size()},
              d.stream);
}

void look_for_missed(CudaTissue& d) {
  if (!d.may_meet) return;
  d.missed.resize(1);
  d.host_missed.resize(1);
  launch_missed(d.tables(), d.present(), d.measures.data(), reach(d), d.near_listed.data(),
                d.missed.data(), d.stream);
  d.missed.download(d.host_missed.data(), 1, d.stream);
}

bool missed_contact(const CudaTissue& d) {
  if (d.may_meet) return d.host_missed[0] != 0;
  const double reach = kSurfaceReach * d.state.scene.cell_size;
  return may_meet(d, d.state.motion, [reach](const BlockMotion&) { return reach; });
}

}  // namespace tissue_sim
