
#include <algorithm>

#include "mpm/lattice/bonds.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

bool has(unsigned bonds, int k) { return (bonds >> k & 1) != 0; }

/// The bonds of a point and of those that it holds on to.
struct BondsAround {
  unsigned own;
  unsigned of[kBondCount] = {};    ///< of the neighbour over each bond, none where that is gone
  std::int32_t point[kBondCount];  ///< that neighbour

  BondsAround(const LatticeBody& body, const Points::Site& s, const Array<std::uint8_t>& bonds,
              std::int32_t p)
      : own(bonds[p]) {
    for (int k = 0; k < kBondCount; ++k) {
      if (!has(own, k)) continue;
      const BondOffset o = bond_offset(k);
      point[k] = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      of[k] = bonds[point[k]];
    }
  }
  BondsAround(const LatticeBody& body, const Points& points, std::int32_t p)
      : BondsAround(body, points.site[p], points.bonds, p) {}
  /// Whether bond `k` is there and in no square of four bonds.
  bool is_bridge(int k) const {
    if (!has(own, k)) return false;
    const unsigned sides = own & of[k] & ~(1u << k | 1u << opposite_bond(k));
    for (int side = 0; side < kBondCount; ++side) {
      if (has(sides, side) && has(of[side], k)) return false;
    }
    return true;
  }
  /// Whether any of the bonds is in a square.
  bool in_square() const {
    for (int k = 0; k < kBondCount; ++k) {
      if (has(own, k) && !is_bridge(k)) return true;
    }
    return false;
  }
  /// Whether any of the bonds is a bridge.
  bool end_bridge() const {
    for (int k = 0; k < kBondCount; ++k) {
      if (is_bridge(k)) return true;
    }
    return false;
  }
};

/// The bridges of a point that may break, as bits.
unsigned weak_bridges(const LatticeTissue& tissue, std::int32_t p) {
  const Points& points = tissue.points;
  const LatticeBody& body = tissue.bodies[points.site[p].body];
  const auto tears = [&](std::int32_t end) {
    return least_tear_limit(body.material_of(points, end)) > 0;
  };
  const BondsAround now(body, points, p);
  const BondsAround whole(body, points.site[p], tissue.whole_bonds, p);
  unsigned weak = 0;
  for (int k = 0; k < kBondCount; ++k) {
    if (!now.is_bridge(k)) continue;
    if (!whole.is_bridge(k) || tears(p) || tears(now.point[k])) weak |= 1u << k;
  }
  return weak;
}

}  // namespace

bool is_drawn_out(const LatticeTissue& tissue, std::int32_t p) {
  const Points::Site& site = tissue.points.site[p];
  const Deformation d(tissue.bodies[site.body], site, *tissue.fields, tissue.nodes);
  return d.stretch >= kThreadStretch && d.stiffening >= kBridgeStiffening;
}

bool ends_lasting_bridge(const LatticeTissue& tissue, std::int32_t p) {
  const LatticeBody& body = tissue.bodies[tissue.points.site[p].body];
  return BondsAround(body, tissue.points, p).end_bridge() && weak_bridges(tissue, p) == 0;
}

bool leaves_thread(const LatticeBody& body, Points& points, std::int32_t point, int k) {
  // Those of the squares that the bond is in.
  std::int32_t held[2 + 2 * kBondCount];
  int count = 0;
  const std::int32_t other = neighbour(body, points.site[point], k);
  held[count++] = point;
  held[count++] = other;
  for (int side = 0; side < kBondCount; ++side) {
    if (side == k || side == opposite_bond(k)) continue;
    for (const std::int32_t end : {point, other}) {
      if (has(points.bonds[end], side)) {
        held[count++] = neighbour(body, points.site[end], side);
      }
    }
  }
  const auto in_square = [&](std::int32_t p) { return BondsAround(body, points, p).in_square(); };
  count = static_cast<int>(
      std::remove_if(held, held + count, [&](std::int32_t p) { return !in_square(p); }) - held);
  const std::uint8_t before[] = {points.bonds[point], points.bonds[other]};
  break_bond(k, points.bonds[point], points.bonds[other]);
  const bool leaves = !std::all_of(held, held + count, in_square);
  points.bonds[point] = before[0];
  points.bonds[other] = before[1];
  return leaves;
}

void list_bridges(const LatticeTissue& tissue, TearRecords& records,
                  const std::vector<std::int32_t>& changed) {
  const Points& points = tissue.points;
  std::vector<std::int32_t>& bridges = records.bridge_ends;
  // Of each cell, by its node: no bridge ends around it. Points come row by row, so that a cell
  // comes up to four times.
  std::vector<std::uint8_t> is_bare(lattice_node_count(tissue.bodies), 0);
  Planes ends{};
  int node = -1;
  Points::Site of{-1, -1, -1, -1};  // the cell that they are around
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    if (s.x / 2 != of.x || s.y / 2 != of.y || s.z / 2 != of.z || s.body != of.body) {
      of = {static_cast<std::int16_t>(s.x / 2), static_cast<std::int16_t>(s.y / 2),
            static_cast<std::int16_t>(s.z / 2), s.body};
      node = tissue.bodies[of.body].node(of.x, of.y, of.z);
      if (is_bare[node] == 0) {
        ends = tissue.fields->bonds().bridge_ends(of.body, of.x, of.y, of.z);
        is_bare[node] = ends == Planes{};
      }
    }
    if (is_bare[node] != 0) continue;
    const auto ends_one = [&](const BondOffset& o) {
      const int x = s.x + o.x, y = s.y + o.y, z = s.z + o.z;
      return (ends[z - 2 * of.z + 2] >> bit_in_plane(x - 2 * of.x + 2, y - 2 * of.y + 2) & 1) != 0;
    };
    if (ends_one({0, 0, 0})) bridges.push_back(p);
    // A square may have lost its far side.
    for (unsigned bonds = points.bonds[p]; bonds != 0; bonds &= bonds - 1) {
      const int k = __builtin_ctz(bonds);
      if (ends_one(bond_offset(k))) bridges.push_back(neighbour(tissue.bodies[s.body], s, k));
    }
  }
  std::sort(bridges.begin(), bridges.end());
  bridges.erase(std::unique(bridges.begin(), bridges.end()), bridges.end());
}

void tear_bridges(BlockTissue& tissue, TearRecords& records, std::vector<std::int32_t>& changed,
                  CutReport& report) {
  const std::size_t first = changed.size();
  Points& points = tissue.points;
  std::vector<std::int32_t> left;
  for (const std::int32_t p : records.bridge_ends) {
    const LatticeBody& body = tissue.bodies[points.site[p].body];
    if (!BondsAround(body, points, p).end_bridge()) continue;
    const unsigned weak = weak_bridges(tissue, p);
    if (weak == 0 || !is_drawn_out(tissue, p)) {
      left.push_back(p);
      continue;
    }
    for (unsigned bridges = weak; bridges != 0; bridges &= bridges - 1) {
      const int k = __builtin_ctz(bridges);
      const std::int32_t other = neighbour(body, points.site[p], k);
      break_bond(k, points.bonds[p], points.bonds[other]);
      changed.push_back(p);
      changed.push_back(other);
      ++report.bonds_broken;
    }
  }
  records.bridge_ends = std::move(left);
  const auto begin = changed.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, changed.end());
  changed.erase(std::unique(begin, changed.end()), changed.end());
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim
