#include "mpm/blocks/block_kernels.h"

#include <algorithm>

#include "mpm/blocks/block_forces.h"
#include "mpm/blocks/block_places.h"
#include "mpm/blocks/block_readings.h"
#include "mpm/blocks/lane_lists.h"

namespace tissue_sim {
namespace {

using namespace kernels;  // NOLINT: this file is all about them

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

#define TISSUE_SIM_KERNELS(suffix, W, target)                                                     \
  target const float* gather_##suffix(const Block& b, const Array<float>* u, BlockScratch& s) {   \
    gather_nodes<W>(b, u, 1.0f, Layout(b), s.nodes);                                              \
    return s.nodes.data();                                                                        \
  }                                                                                               \
  target void forces_##suffix(const Block& b, const BlockField& f, BlockScratch& s, float* out) { \
    forces_any<W>(b, f, s, out);                                                                  \
  }                                                                                               \
  target void positions_##suffix(const Block& b, const BlockField& f, const Array<float>* u,      \
                                 BlockScratch& s, float* out) {                                   \
    positions<W>(b, f, u, s, out);                                                                \
  }                                                                                               \
  target PointBounds bounds_##suffix(const Block& b, const BlockField& f, BlockScratch& s) {      \
    return bounds<W>(b, f, s);                                                                    \
  }                                                                                               \
  target int lanes_in_box_##suffix(const float* x, std::size_t count, const float* min,           \
                                   const float* max, std::int32_t* lanes) {                       \
    return lanes_in_box<W>(x, count, min, max, lanes);                                            \
  }                                                                                               \
  target int lanes_near_##suffix(const LaneSlab(&slabs)[3], const LaneReach& reach,               \
                                 const float* x, const float* y, std::size_t count,               \
                                 NearLane* near) {                                                \
    return lanes_near<W>(slabs, reach, x, y, count, near);                                        \
  }                                                                                               \
  target void update_row_##suffix(const NodeRow& row, const RowPart* parts, const float* force,   \
                                  const UpdateNode& update) {                                     \
    update_row<W>(row, parts, force, update);                                                     \
  }                                                                                               \
  target BlockState state_##suffix(const Block& b, const BlockField& f, BlockScratch& s,          \
                                   float* von_mises) {                                            \
    return state_any<W>(b, f, s, von_mises);                                                      \
  }                                                                                               \
  target BlockState stiffness_##suffix(const Block& b, const BlockField& f, BlockScratch& s) {    \
    return stiffness<W>(b, f, s);                                                                 \
  }                                                                                               \
  target void stretched_##suffix(const Block& b, const BlockField& f, float stretch,              \
                                 BlockScratch& s, std::vector<StretchedPoint>& found) {           \
    stretched<W>(b, f, stretch, s, found);                                                        \
  }

TISSUE_SIM_KERNELS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const BlockKernels& block_kernels(InstructionSet set) {
  static constexpr BlockKernels sse2 = {
      gather_sse2,     forces_sse2,     positions_sse2, bounds_sse2,    lanes_in_box_sse2,
      lanes_near_sse2, update_row_sse2, state_sse2,     stiffness_sse2, stretched_sse2};
#if defined(__x86_64__)
  static constexpr BlockKernels avx2 = {
      gather_avx2,     forces_avx2,     positions_avx2, bounds_avx2,    lanes_in_box_avx2,
      lanes_near_avx2, update_row_avx2, state_avx2,     stiffness_avx2, stretched_avx2};
  static constexpr BlockKernels avx512 = {
      gather_avx512,     forces_avx512,     positions_avx512, bounds_avx512,    lanes_in_box_avx512,
      lanes_near_avx512, update_row_avx512, state_avx512,     stiffness_avx512, stretched_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace tissue_sim
