#include "cutting/cut_tissue.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/block_contact.h"
#include "contact/facet_motion.h"
#include "contact/known_facets.h"
#include "cutting/blade_sweep.h"
#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// Places of the points near a sweep, in the order of the points: both ends of a bond must agree to
/// the last bit on where a point is, or a cut exactly through it might miss the bonds on both
/// sides. The same array twice for tissue at rest.
struct Places {
  const Array<float>&begin, &end;  // [3 * point]
  Vec3 at_begin(std::int32_t p) const { return at(begin, p); }
  Vec3 at_end(std::int32_t p) const { return at(end, p); }
  static Vec3 at(const Array<float>& places, std::int32_t p) {
    return Eigen::Map<const Eigen::Vector3f>(&places[3 * std::size_t(p)]).cast<double>();
  }
};

void read_places(MpmState& state, const Block& block, const Array<float>* u, Array<float>& places) {
  BlockScratch& scratch = state.scratch.local();
  const std::size_t lanes = block.lane_count();
  if (scratch.values.size() < 3 * lanes) scratch.values.resize(3 * lanes);
  const float* x = scratch.values.data();
  state.kernels->positions(block, block_field(state, block), u, scratch, scratch.values.data());
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    if (block.point[lane] < 0) continue;
    float* to = &places[3 * static_cast<std::size_t>(block.point[lane])];
    for (int a = 0; a < 3; ++a) to[a] = x[a * lanes + lane];
  }
}

bool overlap(const Box& a, const Box& b, double margin) {
  return (a.min.array() <= b.max.array() + margin).all() &&
         (b.min.array() <= a.max.array() + margin).all();
}

// A sweep looks at points within this many cells, and at blocks within twice as many, so that a
// bond is seen as long as it is not stretched to three times its length.
constexpr double kReach = 1.5;

/// Whether a box comes near a part of a sweep: its box, and the planes that its edges sweep.
bool is_near(const Box& box, const SweepPart& part, double reach) {
  if (!overlap(box, part.box, reach)) return false;
  const Vec3 middle = 0.5 * (box.min + box.max), half = 0.5 * (box.max - box.min);
  return std::any_of(part.edges.begin(), part.edges.end(), [&](const SweptEdge& e) {
    return std::fabs(e.normal.dot(middle) - e.offset) <=
           e.normal.cwiseAbs().dot(half) + e.thickness + reach;
  });
}

struct Broken {
  std::int32_t point;
  int bond;
  bool has_crossing;
  Crossing crossing;
};

/// The crossing of a forward bond in reference space, from where an edge met it in the world: a
/// normal goes back by F^T.
Broken broken_bond(const MpmState& state, const Block& block, std::size_t lane, int bond,
                   const Array<float>* u, const Meeting& meeting) {
  const std::size_t column = lane % block.stride, sub = lane / block.stride % 8;
  const int cell = static_cast<int>(lane / block.stride / 8) * block.plane + block.cell[column];
  float place[3], F[9];
  for (int a = 0; a < 3; ++a) place[a] = (sub >> a & 1) != 0 ? 0.25f : -0.25f;
  Broken broken{block.point[lane], bond, false, {static_cast<float>(meeting.place), {}}};
  place[bond - kForwardBond] += 0.5f * broken.crossing.place;
  deformation_gradient_at(u, CellNodes(block, cell), state.bodies[block.body].cell_size, place, F);
  Vec3 normal = Vec3::Zero();
  for (int i = 0; i < 9; ++i) normal[i % 3] += F[i] * meeting.normal[i / 3];
  const double length = normal.norm();
  broken.has_crossing = length > 0 && std::isfinite(length);
  for (int a = 0; a < 3; ++a) broken.crossing.normal[a] = static_cast<float>(normal[a] / length);
  return broken;
}

/// The bonds that the parts pass among those that point forward from the points of one block.
void sweep_block(const MpmState& state, const Block& block, const std::vector<SweepPart>& parts,
                 const Places& places, const Array<float>* u, std::vector<Broken>& broken) {
  const LatticeBody& body = state.bodies[block.body];
  const double reach = kReach * body.cell_size;
  Box swept;
  for (const SweepPart& part : parts) {
    swept.min = swept.min.cwiseMin(part.box.min);
    swept.max = swept.max.cwiseMax(part.box.max);
  }
  for (std::size_t lane = 0; lane < block.lane_count(); ++lane) {
    const std::int32_t p = block.point[lane];
    if (p < 0) continue;
    const Vec3 p0 = places.at_begin(p), p1 = places.at_end(p);
    const Box box{p0.cwiseMin(p1), p0.cwiseMax(p1)};
    if (!overlap(box, swept, reach)) continue;
    const auto near = [&](const SweepPart& part) { return is_near(box, part, reach); };
    if (std::none_of(parts.begin(), parts.end(), near)) continue;
    const Points::Site& s = state.points.site[p];
    for (int k = kForwardBond; k < kBondCount; ++k) {
      if ((state.points.bonds[p] >> k & 1) == 0) continue;
      const BondOffset o = bond_offset(k);
      const std::int32_t q = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      const Vec3 q0 = places.at_begin(q), q1 = places.at_end(q);
      for (const SweepPart& part : parts) {
        const MovingSegment bond{p0 + part.begin * (p1 - p0), q0 + part.begin * (q1 - q0),
                                 p0 + part.end * (p1 - p0), q0 + part.end * (q1 - q0)};
        Meeting meeting;
        const auto passes = [&](const SweptEdge& e) {
          return !stays_aside(e, bond) && edge_passes(e, bond, &meeting);
        };
        if (std::any_of(part.edges.begin(), part.edges.end(), passes)) {
          broken.push_back(broken_bond(state, block, lane, k, u, meeting));
          break;
        }
      }
    }
  }
}

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

void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, const std::vector<BlockMotion>& before,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  const std::vector<SweepPart> parts = sweep_parts(path);
  const double reach = 2 * kReach * state.scene.cell_size;
  std::vector<int> near;
  for (std::size_t i = 0; i < state.blocks.all.size(); ++i) {
    const Box& now = state.motion[i].box;
    const Box box{now.min.cwiseMin(before[i].box.min), now.max.cwiseMax(before[i].box.max)};
    const auto meets = [&](const SweepPart& part) { return is_near(box, part, reach); };
    if (std::any_of(parts.begin(), parts.end(), meets)) near.push_back(static_cast<int>(i));
  }
  const int count = static_cast<int>(near.size());
  if (count == 0) return;
  const bool moves = u_begin != u_end;
  for (Array<float>& p : state.places) p.resize(3 * static_cast<std::size_t>(state.points.size()));
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[near[i]];
    read_places(state, block, u_end, state.places[1]);
    if (moves) read_places(state, block, u_begin, state.places[0]);
  });
  const Places places{state.places[moves ? 0 : 1], state.places[1]};
  std::vector<std::vector<Broken>> broken(count);
  state.cpu->for_each(count, [&](int i) {
    sweep_block(state, *state.blocks.all[near[i]], parts, places, u_end, broken[i]);
  });
  const std::size_t first = changed.size();
  for (const std::vector<Broken>& of_block : broken) {
    for (const Broken& b : of_block) {
      const Points::Site& s = state.points.site[b.point];
      const BondOffset o = bond_offset(b.bond);
      const std::int32_t q = state.bodies[s.body].point(s.x + o.x, s.y + o.y, s.z + o.z);
      state.points.bonds[b.point] &= static_cast<std::uint8_t>(~(1u << b.bond));
      state.points.bonds[q] &= static_cast<std::uint8_t>(~(1u << opposite_bond(b.bond)));
      if (b.has_crossing) {
        state.points.crossings[crossing_key(b.point, b.bond - kForwardBond)] = b.crossing;
      }
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
      state.fields->update(state.bodies, state.points, changed, state.nodes, *state.cpu);
  state.blocks.stale_facets.resize(lattice_node_count(state.bodies), 0);
  mark_stale_facets(state.bodies, state.points, changed, state.blocks.stale_facets);
  if (cells.empty()) return;
  keep_face_contacts(state);
  update_blocks(state.blocks, state.bodies, state.points, *state.fields, cells,
                static_cast<int>(state.nodes.size()), *state.cpu);
  state.force.resize(state.blocks.force_size);
  bound_motion(state);
  list_contacts(state);
  list_facets(state);
}

}  // namespace tissue_sim
