// Which sides of what edges sweep boxes and points are on. For sweep_bonds.cpp alone.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "cutting/blade_sweep.h"

namespace tissue_sim {

/// On which sides of what an edge sweeps all of a box is, by more than `reach` [m]: NearLane's
/// `outside`, 0 where it comes near.
inline unsigned outside_of(const SweptEdge& edge, const Box& box, double reach) {
  const Vec3 middle = 0.5 * (box.min + box.max), half = 0.5 * (box.max - box.min);
  unsigned outside = 0;
  for (int i = 0; i < 3; ++i) {
    const Slab& slab = edge.slabs[i];
    const double at = slab.axis.dot(middle), extent = slab.axis.cwiseAbs().dot(half) + reach;
    if (at + extent < slab.low) outside |= 1u << 2 * i;
    if (at - extent > slab.high) outside |= 2u << 2 * i;
  }
  return outside;
}

/// A point near the sweep: its lane in its block, and where it is at the beginning and the end [m].
struct NearPoint {
  std::int32_t lane;
  float at[2][3];
};

/// The same of a point.
inline std::uint8_t outside_of(const SweptEdge& edge, const NearPoint& point, double by) {
  unsigned outside = 0;
  for (int i = 0; i < 3; ++i) {
    const Slab& slab = edge.slabs[i];
    const auto at = [&](const float(&x)[3]) { return slab.axis.dot(Vec3(x[0], x[1], x[2])); };
    const auto [low, high] = std::minmax({at(point.at[0]), at(point.at[1])});
    if (high < slab.low - by) outside |= 1u << 2 * i;
    if (low > slab.high + by) outside |= 2u << 2 * i;
  }
  return static_cast<std::uint8_t>(outside);
}

/// An edge of a part of the path, and its number in all of it.
struct PathEdge {
  const SweepPart* part;
  const SweptEdge* swept;
  std::size_t number;
};

}  // namespace tissue_sim
