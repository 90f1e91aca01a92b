#include "mpm/crumbs.h"

#include <algorithm>
#include <cstring>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// Whether bonds along x hold it together with kCrumbPoints others on one side: most points, seen
/// at a glance. Points are numbered along x.
bool is_in_long_run(const Points& points, std::int32_t point) {
  static_assert(kCrumbPoints == sizeof(std::uint64_t), "a byte for each point");
  constexpr std::uint64_t kForwardInX = 0x0101010101010101 << kForwardBond;
  const auto run_from = [&](std::int32_t first) {
    if (first < 0 || first + kCrumbPoints > points.size()) return false;
    std::uint64_t bonds;
    std::memcpy(&bonds, &points.bonds[first], sizeof(bonds));
    return (bonds & kForwardInX) == kForwardInX;
  };
  return run_from(point) || run_from(point - kCrumbPoints);
}

/// Whether the bonds hold at most kCrumbPoints points together with this one.
bool is_small(const LatticeBody& body, const Points& points, std::int32_t point) {
  std::int32_t piece[kCrumbPoints] = {point};
  int count = 1;
  for (int i = 0; i < count; ++i) {
    const Points::Site& s = points.site[piece[i]];
    for (int k = 0; k < kBondCount; ++k) {
      if ((points.bonds[piece[i]] >> k & 1) == 0) continue;
      const BondOffset o = bond_offset(k);
      const std::int32_t next = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      if (std::find(piece, piece + count, next) != piece + count) continue;
      if (count == kCrumbPoints) return false;
      piece[count++] = next;
    }
  }
  return true;
}

}  // namespace

float elastic_volume(const LatticeBody& body, const Points& points, std::int32_t point) {
  const bool crumb = points.bonds[point] != kAllBonds && body.point_count > kCrumbPoints &&
                     !is_in_long_run(points, point) && is_small(body, points, point);
  return (crumb ? kCrumbStiffness : 1.0f) * points.volume[point];
}

}  // namespace tissue_sim
