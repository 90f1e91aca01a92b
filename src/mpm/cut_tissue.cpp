#include "mpm/cut_tissue.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "mpm/blocks/known_facets.h"
#include "mpm/contact/block_contact.h"
#include "mpm/lattice/bonds.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Bounds the motion of new blocks by that of those which had their points.
void bound_motion(MpmState& state) {
  std::vector<BlockMotion> motion(state.blocks.all.size());
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Blocks::Origin& origin = state.blocks.origin[i];
    for (int b = origin.begin; b < origin.end; ++b) {
      const BlockMotion& part = state.motion[b];
      motion[i].box.min = motion[i].box.min.cwiseMin(part.box.min);
      motion[i].box.max = motion[i].box.max.cwiseMax(part.box.max);
      if (!(part.speed <= motion[i].speed)) motion[i].speed = part.speed;
    }
  }
  state.motion = std::move(motion);
}

}  // namespace

Apart take_apart(MpmState& state, const std::vector<std::int32_t>& changed,
                 const std::function<void()>& meanwhile) {
  Apart apart;
  if (changed.empty()) return apart;
  std::vector<NodeFields::Cell> cells;
  Softened softened;
  state.cpu->both(
      [&] {
        cells = state.fields->update(state.bodies, state.points, changed, state.nodes, *state.cpu);
      },
      [&] {
        softened = soften(state, changed);
        state.blocks.stale_facets.resize(lattice_node_count(state.bodies), 0);
        mark_stale_facets(state, changed, state.blocks.stale_facets);
      });
  for (const std::int32_t p : softened.points) {  // blocks must know
    const Points::Site& s = state.points.site[p];
    cells.push_back({s.body, s.x / 2, s.y / 2, s.z / 2});
  }
  split_front(state);
  settle_debris(state, softened.debris);
  state.debris.insert(softened.debris.begin(), softened.debris.end());
  if (!state.points.free_volume.empty() && !cells.empty()) {
    if (have_rows(state.anchors, state.bodies, cells)) find_face_rows(state, state.anchors);
    if (state.anchors.moves) find_held_nodes(state, state.anchors);
  }
  state.cpu->both(
      [&] {
        if (cells.empty()) return;
        keep_face_contacts(state);
        update_blocks(state.blocks, state, cells, *state.cpu);
        state.cpu->both(
            [&] {
              if (state.work.force.empty()) return;  // blocks are not worked on here
              state.work.force.clear();              // not to be moved to new room
              state.work.force.resize(state.blocks.force_size);
            },
            [&] {
              bound_motion(state);
              list_contacts(state);
              list_facets(state);
            });
      },
      [&] {
        list_bridges(state, state, changed);
        meanwhile();
      });
  follow_front(state, changed, state.anchors.at_row);
  list_front_cells(state);
  apart.softened = std::move(softened.points);
  apart.new_blocks = !cells.empty();
  return apart;
}

void break_bonds(LatticeTissue& state, const std::vector<std::vector<BrokenBond>>& broken,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  // A blade that is held in its cut breaks nothing, frame after frame.
  if (std::all_of(broken.begin(), broken.end(), [](const auto& some) { return some.empty(); })) {
    return;
  }
  Points& points = state.points;
  const auto for_each_bond = [&broken](const auto& f) {
    for (const std::vector<BrokenBond>& some : broken) std::for_each(some.begin(), some.end(), f);
  };
  const std::size_t first = changed.size();
  state.cpu->both(
      [&] {
        std::vector<std::uint64_t> lost(points.size() / 64 + 1, 0);  // a bit of each point
        for_each_bond([&](const BrokenBond& b) {
          break_bond(kForwardBond + b.axis, points.bonds[b.point], points.bonds[b.other]);
          for (const std::int32_t p : {b.point, b.other}) {
            lost[p / 64] |= std::uint64_t{1} << (p % 64);
          }
          ++report.bonds_broken;
        });
        for (std::size_t i = 0; i < lost.size(); ++i) {
          for (std::uint64_t m = lost[i]; m != 0; m &= m - 1) {
            changed.push_back(static_cast<std::int32_t>(64 * i + __builtin_ctzll(m)));
          }
        }
      },
      [&] {
        points.crossings.reserve(points.size());
        for_each_bond([&](const BrokenBond& b) {
          if (b.crossing.place >= 0) points.crossings.add(b.point, b.axis, b.crossing);
        });
      });
  report.points_separated += static_cast<int>(changed.size() - first);
}

std::vector<std::int32_t> break_gaps(LatticeTissue& state) {
  std::vector<std::int32_t> changed;
  CutReport report;
  break_bonds(state, {state.points.gaps}, changed, report);
  if (!changed.empty()) state.whole_bonds = state.points.bonds;
  return changed;
}

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
