// The kernels of blocks for one instruction set. Only for the files block_kernels_*.cpp, one for
// each: together they would take a compiler four minutes.
#pragma once

#include <algorithm>

#include "mpm/blocks/block_forces.h"
#include "mpm/blocks/block_kernels.h"
#include "mpm/blocks/block_places.h"
#include "mpm/blocks/block_readings.h"
#include "mpm/blocks/front_forces.h"

namespace tissue_sim {
namespace {

using namespace kernels;  // NOLINT: these files are all about them

/// Moves W nodes from `first` on, under the components of their forces.
template <int W>
TISSUE_SIM_INLINE void move_nodes(int first, const Vec<W> (&force)[3], const UpdateNode& update) {
  const Vec<W> mass = load<W>(update.mass + first), inv_mass = load<W>(update.inv_mass + first);
  for (int c = 0; c < 3; ++c) {
    float *to_u = update.u[c] + first, *to_v = update.v[c] + first;
    Vec<W> u = load<W>(to_u), v = load<W>(to_v);
    update.move(c, force[c], mass, inv_mass, u, v);
    store<W>(to_u, u);
    store<W>(to_v, v);
  }
}

/// The same for fewer than W.
template <int W>
TISSUE_SIM_INLINE void move_rest(int first, int count, const Vec<W> (&force)[3],
                                 const UpdateNode& update) {
  float of[3][W];
  for (int c = 0; c < 3; ++c) store<W>(of[c], force[c]);
  int i = 0;
  for (; i + 4 <= count; i += 4) {
    move_nodes<4>(first + i, {load<4>(of[0] + i), load<4>(of[1] + i), load<4>(of[2] + i)}, update);
  }
  for (; i < count; ++i) update(first + i, of[0][i], of[1][i], of[2][i]);
}

template <int W>
TISSUE_SIM_INLINE void update_row(const NodeRow& row, const RowPart* parts, const float* force,
                                  const UpdateNode& update) {
  for (int i = 0; i < row.count; i += W) {
    Vec<W> sum[3] = {};
    for (int p = 0; p < row.part_count; ++p) {
      const int begin = parts[p].begin - i, end = begin + parts[p].count;
      if (begin >= W || end <= 0) continue;
      const Mask<W> counts = lanes_between<W>(begin, end);
      const float* from = force + parts[p].force - begin;
      for (int c = 0; c < 3; ++c) {
        sum[c] += keep<W>(counts, load<W>(from + c * parts[p].component));
      }
    }
    const int first = row.first_node + i, count = row.count - i;
    if (count >= W) {
      move_nodes<W>(first, sum, update);
    } else {
      move_rest<W>(first, count, sum, update);
    }
  }
}

#define TISSUE_SIM_KERNELS(suffix, W, target)                                                      \
  target const float* gather_##suffix(const Block& b, const Array<float>* u, BlockScratch& s) {    \
    gather_nodes<W>(b, u, 1.0f, Layout(b), s.nodes);                                               \
    return s.nodes.data();                                                                         \
  }                                                                                                \
  target void forces_##suffix(const Block& b, const BlockField& f, BlockScratch& s, float* out) {  \
    forces_any<W>(b, f, s, out);                                                                   \
  }                                                                                                \
  target void positions_##suffix(const Block& b, const BlockField& f, const Array<float>* u,       \
                                 BlockScratch& s, float* out) {                                    \
    positions<W>(b, f, u, s, out);                                                                 \
  }                                                                                                \
  target PointBounds bounds_##suffix(const Block& b, const BlockField& f, BlockScratch& s) {       \
    return bounds<W>(b, f, s);                                                                     \
  }                                                                                                \
  target int lanes_in_box_##suffix(const float* x, std::size_t count, const float* min,            \
                                   const float* max, std::int32_t* lanes) {                        \
    return lanes_in_box<W>(x, count, min, max, lanes);                                             \
  }                                                                                                \
  target int lanes_near_##suffix(const LaneSlab(&slabs)[3], const LaneReach& reach,                \
                                 const float* x, const float* y, std::size_t count,                \
                                 NearLane* near) {                                                 \
    return lanes_near<W>(slabs, reach, x, y, count, near);                                         \
  }                                                                                                \
  target void update_row_##suffix(const NodeRow& row, const RowPart* parts, const float* force,    \
                                  const UpdateNode& update) {                                      \
    update_row<W>(row, parts, force, update);                                                      \
  }                                                                                                \
  target BlockState state_##suffix(const Block& b, const BlockField& f, BlockScratch& s,           \
                                   float* von_mises) {                                             \
    return state_any<W>(b, f, s, von_mises);                                                       \
  }                                                                                                \
  target BlockState stiffness_##suffix(const Block& b, const BlockField& f, BlockScratch& s) {     \
    return stiffness<W>(b, f, s);                                                                  \
  }                                                                                                \
  target void stretched_##suffix(const Block& b, const BlockField& f, float stretch,               \
                                 BlockScratch& s, std::vector<StretchedPoint>& found) {            \
    stretched<W>(b, f, stretch, s, found);                                                         \
  }                                                                                                \
                                                                                                   \
  target void front_##suffix(const FrontCell& c, const FrontField& f, float* force, float* pull) { \
    front_forces_any(c, f, force, pull);                                                           \
  }                                                                                                \
  target double front_energy_##suffix(const FrontCell& c, const FrontField& f) {                   \
    return front_energy_any(c, f);                                                                 \
  }                                                                                                \
                                                                                                   \
  constexpr BlockKernels kKernels_##suffix = {                                                     \
      gather_##suffix,       forces_##suffix,     positions_##suffix,  bounds_##suffix,            \
      lanes_in_box_##suffix, lanes_near_##suffix, update_row_##suffix, state_##suffix,             \
      stiffness_##suffix,    stretched_##suffix,  front_##suffix,      front_energy_##suffix};

}  // namespace
}  // namespace tissue_sim
