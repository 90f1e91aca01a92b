#include "mpm/piece_motion.h"

namespace tissue_sim {
namespace {

/// What a block's points of one piece add up to.
struct Sums {
  int id = -1;
  double volume = 0;
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();  // times volume
  Box box;
};

/// The entry of a piece; a block meets few of them, most often the same as for the point before.
Sums& sums_of(std::vector<Sums>& all, int id) {
  for (auto s = all.rbegin(); s != all.rend(); ++s) {
    if (s->id == id) return *s;
  }
  all.emplace_back();
  all.back().id = id;
  return all.back();
}

}  // namespace

void measure_pieces(MpmState& state, Pieces& pieces) {
  const int count = static_cast<int>(state.blocks.all.size());
  std::vector<std::vector<Sums>> of_block(count);
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[i];
    BlockScratch& scratch = state.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 6 * lanes) scratch.values.resize(6 * lanes);
    float *x = scratch.values.data(), *v = x + 3 * lanes;
    const BlockField field = block_field(state, block);
    state.kernels->positions(block, field, state.nodes.u, scratch, x);
    state.kernels->positions(block, at_rest(field), state.nodes.v, scratch, v);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      Sums& s = sums_of(of_block[i], pieces.of_point[p]);
      const double volume = state.points.volume[p];
      const Vec3 at(x[lane], x[lanes + lane], x[2 * lanes + lane]);
      s.volume += volume;
      s.x += volume * at;
      s.v += volume * Vec3(v[lane], v[lanes + lane], v[2 * lanes + lane]);
      s.box.min = s.box.min.cwiseMin(at);
      s.box.max = s.box.max.cwiseMax(at);
    }
  });
  std::vector<Sums> total(pieces.next_id);
  for (const std::vector<Sums>& block : of_block) {
    for (const Sums& s : block) {
      Sums& t = total[s.id];
      t.volume += s.volume;
      t.x += s.x;
      t.v += s.v;
      t.box.min = t.box.min.cwiseMin(s.box.min);
      t.box.max = t.box.max.cwiseMax(s.box.max);
    }
  }
  for (Fragment& f : pieces.all) {
    const Sums& t = total[f.id];
    f.centroid = t.x / t.volume;
    f.velocity = t.v / t.volume;
    f.box = t.box;
  }
}

}  // namespace tissue_sim
