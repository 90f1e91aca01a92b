// Where a block's points are, and other values of nodes at its points. For kernel_set.h alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mpm/blocks/block_kernels.h"
#include "mpm/blocks/block_planes.h"

namespace tissue_sim {
namespace kernels {

/// Adds the nodes' reference places to the displacements that gather_nodes() brought.
TISSUE_SIM_INLINE void add_reference(const Block& b, const BlockField& f, const Layout& l,
                                     float* nodes) {
  for (int z = 0; z < b.nz + 2; ++z) {
    for (int y = 0; y < b.ny + 2; ++y) {
      float* row = nodes + z * l.plane + y * l.pitch;
      for (const Block::Side& side : b.sides) {
        const int first = side.x - b.x;
        for (int x = 0; x < side.count; ++x) {
          row[side.column + x] += f.origin[0] + (first + x) * f.cell_size;
        }
      }
      for (int x = 0; x < l.pitch; ++x) {
        row[x + l.node_component] += f.origin[1] + y * f.cell_size;
        row[x + 2 * l.node_component] += f.origin[2] + z * f.cell_size;
      }
    }
  }
}

/// Calls f(lane, x) for the points of all cells, W of them side by side: `lane` of the first point
/// of the first, x[3][8] their places.
template <int W, class F>
TISSUE_SIM_INLINE void for_each_place(const Block& b, const BlockField& f, const Array<float>* u,
                                      BlockScratch& scratch, const F& visit) {
  const Layout l(b);
  reserve(scratch.in, 3 * l.in_plane);
  gather_nodes<W>(b, u, 1.0f, l, scratch.nodes);
  add_reference(b, f, l, scratch.nodes.data());
  const int in_plane = 3 * kValueXyCount * l.quantity;
  const float* in = scratch.in.data();
  for (int z = 0; z < 2; ++z) load_values<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_values<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int j = 0; j < l.stride; j += W) {
      Vec<W> x[3][8];
#pragma GCC unroll 3
      for (int c = 0; c < 3; ++c) {
        Vec<W> w[2][kValueXyCount];
        for (int k = 0; k < kValueXyCount; ++k) {
          const float* q = in + (c * kValueXyCount + k) * l.quantity + j;
          const Line<Vec<W>> line(load<W>(q + (z % 3) * in_plane),
                                  load<W>(q + ((z + 1) % 3) * in_plane),
                                  load<W>(q + ((z + 2) % 3) * in_plane));
          w[0][k] = line.A - 0.125f * line.d;
          w[1][k] = line.A + 0.125f * line.d;
        }
        for (int s = 0; s < 8; ++s) {
          const Vec<W>* v = w[s / 4];
          const float by_x = s & 1 ? 0.125f : -0.125f, by_y = s & 2 ? 0.125f : -0.125f;
          x[c][s] = v[kValueAA] + by_x * v[kValuedA] + by_y * (v[kValueAd] + by_x * v[kValuedd]);
        }
      }
      visit(static_cast<std::size_t>(z) * 8 * l.stride + j, x);
    }
  }
}

template <int W>
TISSUE_SIM_INLINE void positions(const Block& b, const BlockField& f, const Array<float>* u,
                                 BlockScratch& scratch, float* out) {
  const std::size_t lanes = b.lane_count();
  for_each_place<W>(b, f, u, scratch,
                    [&](std::size_t lane, const auto& x) TISSUE_SIM_INLINE_LAMBDA {
                      for (int c = 0; c < 3; ++c) {
                        for (int s = 0; s < 8; ++s)
                          store<W>(out + c * lanes + lane + s * b.stride, x[c][s]);
                      }
                    });
}

/// The lanes that hold points, all bits set of each.
template <int W>
TISSUE_SIM_INLINE Mask<W> hold_points(const float* volume) {
  return -bits<W>(load<W>(volume)) >> 31;
}

template <int W>
TISSUE_SIM_INLINE PointBounds bounds(const Block& b, const BlockField& f, BlockScratch& scratch) {
  const float* volume = b.volume.data();
  PointBounds result;
  Vec<W> min[3], max[3];
  for (int c = 0; c < 3; ++c) {
    min[c] = Vec<W>{} + result.min[c];
    max[c] = Vec<W>{} + result.max[c];
  }
  for_each_place<W>(
      b, f, f.nodes->u, scratch, [&](std::size_t lane, const auto& x) TISSUE_SIM_INLINE_LAMBDA {
        for (int s = 0; s < 8; ++s) {
          const Mask<W> inside = hold_points<W>(volume + lane + s * b.stride);
          for (int c = 0; c < 3; ++c) {  // nothing but `v < w ? v : w` becomes one instruction
            const Vec<W> low = either<W>(inside, x[c][s], min[c]);
            const Vec<W> high = either<W>(inside, x[c][s], max[c]);
            min[c] = low < min[c] ? low : min[c];
            max[c] = high > max[c] ? high : max[c];
          }
        }
      });
  // By their bits, which order what is not negative: what is no number is the largest.
  Mask<W> speed2 = {};
  for_each_place<W>(b, at_rest(f), f.nodes->v, scratch,
                    [&](std::size_t lane, const auto& v) TISSUE_SIM_INLINE_LAMBDA {
                      for (int s = 0; s < 8; ++s) {
                        const Vec<W> v2 = v[0][s] * v[0][s] + v[1][s] * v[1][s] + v[2][s] * v[2][s];
                        const Mask<W> of_points =
                            bits<W>(v2) & 0x7fffffff & hold_points<W>(volume + lane + s * b.stride);
                        speed2 = of_points > speed2 ? of_points : speed2;
                      }
                    });
  std::int32_t largest = 0;
  for (int i = 0; i < W; ++i) {
    largest = std::max(largest, static_cast<std::int32_t>(speed2[i]));
    for (int c = 0; c < 3; ++c) {
      result.min[c] = std::min(result.min[c], min[c][i]);
      result.max[c] = std::max(result.max[c], max[c][i]);
    }
  }
  std::memcpy(&result.speed, &largest, sizeof(largest));
  result.speed = std::sqrt(result.speed);
  return result;
}

}  // namespace kernels

namespace kernels {

template <int W>
TISSUE_SIM_INLINE int lanes_in_box(const float* x, std::size_t count, const float* min,
                                   const float* max, std::int32_t* lanes) {
  int found = 0;
  for (std::size_t j = 0; j < count; j += W) {
    Mask<W> outside = {};
    for (int a = 0; a < 3; ++a) {
      const Vec<W> v = load<W>(x + a * count + j);
      outside |= bits<W>(v - min[a]) | bits<W>(max[a] - v);
    }
    if (!any_negative<W>(~outside)) continue;
    for (int i = 0; i < W; ++i) {
      if (outside[i] >= 0) lanes[found++] = static_cast<std::int32_t>(j) + i;
    }
  }
  return found;
}

/// All bits set where both of two values are below a limit.
template <int W>
TISSUE_SIM_INLINE Mask<W> both_below(Vec<W> a, Vec<W> b, float limit) {
  return (bits<W>(a - limit) & bits<W>(b - limit)) >> 31;
}

template <int W>
TISSUE_SIM_INLINE int lanes_near(const LaneSlab (&slabs)[3], const LaneReach& reach, const float* x,
                                 const float* y, std::size_t count, NearLane* near) {
  int found = 0;
  for (std::size_t j = 0; j < count; j += W) {
    Mask<W> unlisted = {}, far = {}, outside = {};
    for (int i = 0; i < 3; ++i) {
      const LaneSlab& s = slabs[i];
      const auto along = [&](const float* v) TISSUE_SIM_INLINE_LAMBDA {
        return s.axis[0] * load<W>(v + j) + s.axis[1] * load<W>(v + count + j) +
               s.axis[2] * load<W>(v + 2 * count + j);
      };
      const Vec<W> a = along(x), b = along(y);
      const auto below = [&](float by)
                             TISSUE_SIM_INLINE_LAMBDA { return both_below<W>(a, b, s.low - by); };
      const auto above = [&](float by) TISSUE_SIM_INLINE_LAMBDA {
        return both_below<W>(-a, -b, -s.high - by);
      };
      unlisted |= below(reach.listed) | above(reach.listed);
      far |= below(reach.near) | above(reach.near);
      outside |= (below(reach.outside) & (1 << 2 * i)) | (above(reach.outside) & (2 << 2 * i));
    }
    if (!any_negative<W>(~unlisted)) continue;
    for (int i = 0; i < W; ++i) {
      if (unlisted[i] != 0) continue;
      near[found++] = {static_cast<std::int32_t>(j) + i, static_cast<std::uint8_t>(outside[i]),
                       far[i] == 0};
    }
  }
  return found;
}

}  // namespace kernels

}  // namespace tissue_sim
