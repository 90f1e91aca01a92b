#include "mpm/piece_motion.h"

#include "fragments/piece_sums.h"
#include "mpm/point_fields.h"

namespace tissue_sim {

void measure_pieces(MpmState& state, Pieces& pieces) {
  const int count = static_cast<int>(state.blocks.all.size());
  std::vector<SumsByPiece> of_block(count);
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[i];
    BlockScratch& scratch = state.work.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 6 * lanes) scratch.values.resize(6 * lanes);
    float *x = scratch.values.data(), *v = x + 3 * lanes;
    const BlockField field = block_field(state, block);
    state.kernels->positions(block, field, state.nodes.u, scratch, x);
    state.kernels->positions(block, at_rest(field), state.nodes.v, scratch, v);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      Vec3 place(x[lane], x[lanes + lane], x[2 * lanes + lane]);
      Vec3 velocity(v[lane], v[lanes + lane], v[2 * lanes + lane]);
      if (held_place(state, p, place) && !state.anchors.moves) velocity.setZero();
      of_block[i].of(pieces.of_point[p]).add(state.points.volume[p], place, velocity);
    }
  });
  set_motion(of_block, pieces);
}

}  // namespace tissue_sim
