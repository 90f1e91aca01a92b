#include "mpm/blocks/block_tissue.h"

namespace tissue_sim {

BlockField block_field(const LatticeTissue& state, const Block& block) {
  const LatticeBody& b = state.bodies[block.body];
  const Vec3 origin = b.node_position(block.x - 1, block.y - 1, block.z - 1);
  BlockField f;
  f.nodes = &state.nodes;
  f.cell_size = static_cast<float>(b.cell_size);
  for (int a = 0; a < 3; ++a) f.origin[a] = static_cast<float>(origin[a]);
  const bool mixed = block.material == Block::kMixed;
  const Material& m = b.materials[mixed ? 0 : block.material];
  f.law = mixed ? block.mixture.law : m.law;
  f.mu = static_cast<float>(lame_mu(m));
  f.lambda = static_cast<float>(lame_lambda(m));
  f.viscosity = static_cast<float>(m.viscosity);
  f.material = state.points.material.empty() ? nullptr : state.points.material.data();
  f.soft = state.points.soft.empty() ? nullptr : state.points.soft.data();
  f.lightness = state.points.lightness.empty() ? nullptr : state.points.lightness.data();
  f.bonds = state.points.bonds.data();
  f.whole_bonds = state.whole_bonds.data();
  f.material_count = static_cast<int>(b.materials.size());
  return f;
}

namespace {

/// Widens a block's box to its points without free volume, which move with their anchors.
void add_held(const BlockTissue& state, const Block& block, Box& box) {
  const LatticeBody& b = state.bodies[block.body];
  // What is kept of them has no more than this.
  const float little = kept_volume(static_cast<float>(b.cell_size));
  for (std::size_t first = 0; first < block.volume.size(); first += kLanes) {
    int held = 0;
    for (int i = 0; i < kLanes; ++i) {
      held |=
          static_cast<int>(!(block.volume[first + i] > little)) & ~(block.point[first + i] >> 31);
    }
    if (held == 0) continue;
    for (std::size_t lane = first; lane < first + kLanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (p < 0 || state.points.free_volume_of(p) > 0) continue;
      const Points::Site& s = state.points.site[p];
      Vec3 x = b.site_position(s.x, s.y, s.z);
      if (state.anchors.moves) x = state.anchors.place_of_held(b.body, block.body, x);
      box.min = box.min.cwiseMin(x);
      box.max = box.max.cwiseMax(x);
    }
  }
}

}  // namespace

void measure_motion(BlockTissue& state) {
  const int count = static_cast<int>(state.blocks.all.size());
  state.motion.resize(count);
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[i];
    const PointBounds b =
        state.kernels->bounds(block, block_field(state, block), state.scratch.local());
    state.motion[i] = {{Vec3(b.min[0], b.min[1], b.min[2]), Vec3(b.max[0], b.max[1], b.max[2])},
                       b.speed};
    if (!state.points.free_volume.empty()) add_held(state, block, state.motion[i].box);
  });
}

}  // namespace tissue_sim
