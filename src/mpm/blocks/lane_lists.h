// Which lanes of a block lie where. For block_kernels.cpp alone.
#pragma once

#include "mpm/blocks/block_kernels.h"

namespace tissue_sim {
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
