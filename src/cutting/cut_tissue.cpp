#include "cutting/cut_tissue.h"

#include <algorithm>
#include <utility>

#include "contact/block_contact.h"
#include "cutting/blade_sweep.h"
#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// Places of a block's points at the beginning and at the end.
struct BlockPlaces {
  Array<float> begin, end;
  Box box;  // of the points, over the whole motion
};

Vec3 place(const Array<float>& x, std::size_t lanes, std::size_t lane) {
  return Vec3(x[lane], x[lanes + lane], x[2 * lanes + lane]);
}

bool overlap(const Box& a, const Box& b, double margin) {
  return (a.min.array() <= b.max.array() + margin).all() &&
         (b.min.array() <= a.max.array() + margin).all();
}

/// Place of one point, from its 27 nodes.
Vec3 point_place(const MpmState& state, std::int32_t p, const Array<float>* u) {
  const Points::Site& s = state.points.site[p];
  const LatticeBody& b = state.bodies[s.body];
  Vec3 x = b.site_position(s.x, s.y, s.z);
  for (int k = 0; k < 27; ++k) {
    const int n = state.fields->node(b, s, k);
    x += static_cast<double>(site_weight(s, k)) * Vec3(u[0][n], u[1][n], u[2][n]);
  }
  return x;
}

struct Broken {
  std::int32_t point;
  int bond;
};

/// The bonds that the parts pass among those that point forward from the points of one block.
void sweep_block(const MpmState& state, int index, const std::vector<SweepPart>& parts,
                 const Array<float>* u_begin, const Array<float>* u_end,
                 std::vector<Broken>& broken) {
  const Block& block = *state.blocks.all[index];
  const LatticeBody& body = state.bodies[block.body];
  const std::size_t lanes = block.lane_count();
  BlockScratch scratch;
  BlockPlaces at;
  at.begin.resize(3 * lanes);
  state.kernels->positions(block, block_field(state, block), u_begin, scratch, at.begin.data());
  const bool moving = u_begin != u_end;
  if (moving) {
    at.end.resize(3 * lanes);
    state.kernels->positions(block, block_field(state, block), u_end, scratch, at.end.data());
  }
  const Array<float>& end = moving ? at.end : at.begin;
  // A bond may be stretched: a point is looked at when it is within three of its lengths at rest.
  const double reach = 1.5 * body.cell_size;
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::int32_t p = block.point[lane];
    if (p < 0) continue;
    const Vec3 p0 = place(at.begin, lanes, lane), p1 = place(end, lanes, lane);
    const Box box{p0.cwiseMin(p1), p0.cwiseMax(p1)};
    bool near = false;
    for (const SweepPart& part : parts) near = near || overlap(box, part.box, reach);
    if (!near) continue;
    const Points::Site& s = state.points.site[p];
    for (int k = kForwardBond; k < kBondCount; ++k) {
      if ((state.points.bonds[p] >> k & 1) == 0) continue;
      const BondOffset o = bond_offset(k);
      const std::int32_t q = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      const Vec3 q0 = point_place(state, q, u_begin);
      const Vec3 q1 = moving ? point_place(state, q, u_end) : q0;
      for (const SweepPart& part : parts) {
        const MovingSegment bond{p0 + part.begin * (p1 - p0), q0 + part.begin * (q1 - q0),
                                 p0 + part.end * (p1 - p0), q0 + part.end * (q1 - q0)};
        const auto passes = [&bond](const MovingSegment& e) { return edge_passes(e, bond); };
        if (std::any_of(part.edges.begin(), part.edges.end(), passes)) {
          broken.push_back({p, k});
          break;
        }
      }
    }
  }
}

}  // namespace

void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, std::vector<std::int32_t>& changed, CutReport& report) {
  const std::vector<SweepPart> parts = sweep_parts(path);
  const int count = static_cast<int>(state.blocks.all.size());
  std::vector<std::vector<Broken>> broken(count);
  state.cpu->for_each(count, [&](int i) {
    Box box;
    const Block& block = *state.blocks.all[i];
    const LatticeBody& b = state.bodies[block.body];
    for (int z = 0; z < block.nz + 2; ++z) {
      for (int y = 0; y < block.ny + 2; ++y) {
        for (int x = 0; x < block.pitch; ++x) {
          const int n = block.node[z * block.plane + y * block.pitch + x];
          if (state.nodes.mass[n] <= 0) continue;
          const Vec3 X = b.node_position(block.x + x - 1, block.y + y - 1, block.z + z - 1);
          for (const Array<float>* u : {u_begin, u_end}) {
            const Vec3 at = X + Vec3(u[0][n], u[1][n], u[2][n]);
            box.min = box.min.cwiseMin(at);
            box.max = box.max.cwiseMax(at);
          }
        }
      }
    }
    const auto meets = [&](const SweepPart& part) { return overlap(box, part.box, b.cell_size); };
    if (std::any_of(parts.begin(), parts.end(), meets)) {
      sweep_block(state, i, parts, u_begin, u_end, broken[i]);
    }
  });
  const std::size_t first = changed.size();
  for (const std::vector<Broken>& of_block : broken) {
    for (const Broken& b : of_block) {
      const Points::Site& s = state.points.site[b.point];
      const BondOffset o = bond_offset(b.bond);
      const std::int32_t q = state.bodies[s.body].point(s.x + o.x, s.y + o.y, s.z + o.z);
      state.points.bonds[b.point] &= static_cast<std::uint8_t>(~(1u << b.bond));
      state.points.bonds[q] &= static_cast<std::uint8_t>(~(1u << opposite_bond(b.bond)));
      changed.push_back(b.point);
      changed.push_back(q);
      ++report.bonds_broken;
    }
  }
  std::sort(changed.begin() + first, changed.end());
  changed.erase(std::unique(changed.begin() + first, changed.end()), changed.end());
  report.points_separated += static_cast<int>(changed.size() - first);
}

void take_apart(MpmState& state, const std::vector<std::int32_t>& changed) {
  if (changed.empty()) return;
  const std::vector<NodeFields::Cell> cells =
      state.fields->update(state.bodies, state.points, changed, state.nodes);
  if (cells.empty()) return;
  update_blocks(state.blocks, state.bodies, state.points, *state.fields, cells,
                static_cast<int>(state.nodes.size()));
  state.force.resize(state.blocks.force_size);
  list_contacts(state);
}

}  // namespace tissue_sim
