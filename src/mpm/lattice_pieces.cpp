#include "mpm/lattice_pieces.h"

#include <algorithm>
#include <cstring>

#include "mpm/lattice/bonds.h"

namespace tissue_sim {
std::vector<PointRun> runs_along_x(const std::uint8_t* bonds, std::int32_t count) {
  constexpr std::uint64_t kBackInX = 0x0101010101010101 << opposite_bond(kForwardBond);
  std::vector<PointRun> runs;
  for (std::int32_t p = 0; p < count;) {
    std::uint64_t of_eight = 0;
    std::memcpy(&of_eight, &bonds[p], std::min(8, count - p));
    const std::uint64_t gone = ~of_eight & kBackInX;
    if (gone == 0) {
      p += 8;
      continue;
    }
    p += __builtin_ctzll(gone) / 8;
    if (p >= count) break;
    if (!runs.empty()) runs.back().end = p;
    runs.push_back({p, count});
    ++p;
  }
  return runs;
}

UnionFind linked_runs(const LatticeTissue& tissue, const std::uint8_t* bonds,
                      const std::vector<PointRun>& runs) {
  UnionFind linked(runs.size());
  for (const int k : {kForwardBond + 1, kForwardBond + 2}) {
    const BondOffset o = bond_offset(k);
    std::size_t other = 0;  // only goes up: points are numbered along x, then y, then z
    for (std::size_t i = 0; i < runs.size(); ++i) {
      for (std::int32_t p = runs[i].begin; p < runs[i].end;) {
        if ((bonds[p] >> k & 1) == 0) {
          ++p;
          continue;
        }
        const Points::Site& s = tissue.points.site[p];
        const std::int32_t q = tissue.bodies[s.body].point(s.x, s.y + o.y, s.z + o.z);
        while (runs[other].end <= q) ++other;
        linked.join(static_cast<std::int32_t>(i), static_cast<std::int32_t>(other));
        p += std::min(runs[i].end - p, runs[other].end - q);
      }
    }
  }
  return linked;
}

Pieces whole_pieces(const LatticeTissue& tissue) {
  Pieces pieces = one_piece_a_body(
      static_cast<int>(tissue.bodies.size()),
      {tissue.points.size(), [&](std::int32_t p) { return tissue.points.site[p].body; },
       tissue.points.volume.data(), tissue.points.anchored.data()});
  update_pieces(tissue, pieces);  // a mesh may have parts that do not touch
  return pieces;
}

bool may_have_parted(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed) {
  Planes components[216];
  int count = 0;
  Points::Site of{-1, -1, -1, -1};  // the cell that they are around
  for (const std::int32_t p : changed) {
    const Points::Site& s = tissue.points.site[p];
    const LatticeBody& body = tissue.bodies[s.body];
    if (s.x / 2 != of.x || s.y / 2 != of.y || s.z / 2 != of.z || s.body != of.body) {
      of = {static_cast<std::int16_t>(s.x / 2), static_cast<std::int16_t>(s.y / 2),
            static_cast<std::int16_t>(s.z / 2), s.body};
      count = tissue.fields->bonds().find_components(of.body, of.x, of.y, of.z, components);
    }
    const auto component_of = [&](int x, int y, int z) {
      const int plane = z - 2 * of.z + 2, bit = bit_in_plane(x - 2 * of.x + 2, y - 2 * of.y + 2);
      int i = 0;
      while (i < count && (components[i][plane] >> bit & 1) == 0) ++i;
      return i;
    };
    const int own = component_of(s.x, s.y, s.z);
    for (int k = 0; k < kBondCount; ++k) {
      if ((tissue.points.bonds[p] >> k & 1) != 0) continue;
      const BondOffset o = bond_offset(k);
      const int x = s.x + o.x, y = s.y + o.y, z = s.z + o.z;
      if (body.point(x, y, z) >= 0 && component_of(x, y, z) != own) return true;
    }
  }
  return false;
}

std::vector<int> update_pieces(const LatticeTissue& tissue, Pieces& pieces) {
  const std::vector<PointRun> runs = runs_along_x(tissue.points.bonds.data(), tissue.points.size());
  UnionFind linked = linked_runs(tissue, tissue.points.bonds.data(), runs);
  std::vector<PartedRun> parted;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::int32_t lowest = runs[linked.root(static_cast<std::int32_t>(i))].begin;
    if (pieces.lowest[pieces.of_point[runs[i].begin]] == lowest) continue;
    parted.push_back({runs[i].begin, runs[i].end, lowest});
  }
  return part_pieces(tissue.points.volume.data(), parted, pieces);
}

}  // namespace tissue_sim
