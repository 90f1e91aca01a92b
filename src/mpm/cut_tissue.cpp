#include "mpm/cut_tissue.h"

#include <algorithm>
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
  land_changed(state, changed);
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

}  // namespace tissue_sim
