#include <algorithm>
#include <cmath>

#include "contact/facet_motion.h"
#include "cutting/blade_sweep.h"
#include "cutting/bonds.h"
#include "cutting/cut_tissue.h"

namespace tissue_sim {
namespace {

// Points within this many cells are brought: few bonds of those that are looked at end elsewhere.
constexpr double kBringReach = 2 * kSweepReach;

/// Whether a box comes near what an edge sweeps.
bool is_near(const Box& box, const SweptEdge& edge, double reach) {
  const Vec3 middle = 0.5 * (box.min + box.max), half = 0.5 * (box.max - box.min);
  return std::all_of(std::begin(edge.slabs), std::end(edge.slabs), [&](const Slab& slab) {
    const double at = slab.axis.dot(middle), extent = slab.axis.cwiseAbs().dot(half) + reach;
    return at - extent <= slab.high && at + extent >= slab.low;
  });
}

/// An edge of a part of the path.
struct NearEdge {
  const SweepPart* part;
  const SweptEdge* edge;
};

/// What is known of where a point is: NearLane::outside, and whether it was brought and is near.
constexpr unsigned kOutside = 0x3f, kBrought = 0x40, kNear = 0x80;

/// Sweeps one path through one block at a time.
class Sweep {
 public:
  Sweep(MpmState& state, const BladePath& path, const Array<float>* u_begin,
        const Array<float>* u_end)
      : state_(state),
        parts_(sweep_parts(path)),
        one_edge_(parts_.size() == 1 && parts_[0].edges.size() == 1),
        u_begin_(u_begin),
        u_end_(u_end),
        known_(state.points.size(), 0) {}

  /// A block that is near edges of the path, and the lanes that are.
  struct Passed {
    const Block* block;
    std::vector<NearEdge> edges;
    std::vector<std::int32_t> lanes;
  };
  /// `box` is the block's, from the beginning to the end.
  Passed passed(const Block& block, const Box& box) const {
    const double reach = kBringReach * state_.scene.cell_size;
    Passed result{&block, {}, {}};
    for (const SweepPart& part : parts_) {
      for (const SweptEdge& edge : part.edges) {
        if (is_near(box, edge, reach)) result.edges.push_back({&part, &edge});
      }
    }
    return result;
  }

  /// Fills MpmState::places and `known` for a block's points near the sweep and lists the lanes of
  /// those that are nearest.
  void read_places(Passed& passed) {
    const Block& block = *passed.block;
    BlockScratch& scratch = state_.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 6 * lanes) scratch.values.resize(6 * lanes);
    if (scratch.near.size() < lanes) scratch.near.resize(lanes);
    float *end = scratch.values.data(), *begin = moves() ? end + 3 * lanes : end;
    const BlockField field = block_field(state_, block);
    state_.kernels->positions(block, field, u_end_, scratch, end);
    if (moves()) state_.kernels->positions(block, field, u_begin_, scratch, begin);
    const auto reach = static_cast<float>(kSweepReach * state_.scene.cell_size);
    float *at_begin = state_.places[0].data(), *at_end = state_.places[1].data();
    for (const NearEdge& edge : passed.edges) {
      LaneSlab slabs[3];
      for (int i = 0; i < 3; ++i) {
        const Slab& s = edge.edge->slabs[i];
        slabs[i] = {
            {float(s.axis[0]), float(s.axis[1]), float(s.axis[2])}, float(s.low), float(s.high)};
      }
      const int count = state_.kernels->lanes_near(slabs, {2 * reach, reach, 0.01f * reach}, begin,
                                                   end, lanes, scratch.near.data());
      for (int i = 0; i < count; ++i) {
        const NearLane& near = scratch.near[i];
        const std::int32_t p = block.point[near.lane];
        if (p < 0) continue;
        for (int a = 0; a < 3; ++a) {
          at_end[3 * std::size_t(p) + a] = end[a * lanes + near.lane];
          if (moves()) at_begin[3 * std::size_t(p) + a] = begin[a * lanes + near.lane];
        }
        if (near.near && (known_[p] & kNear) == 0) passed.lanes.push_back(near.lane);
        known_[p] |= kBrought | (near.near ? kNear : 0) | (one_edge_ ? near.outside : 0);
      }
    }
  }

  /// The bonds that point forward from the block's points and that the path passes.
  std::vector<BrokenBond> broken_bonds(const Passed& passed) const {
    std::vector<BrokenBond> broken;
    const Block& block = *passed.block;
    for (const std::int32_t lane : passed.lanes) {
      const std::int32_t p = block.point[lane];
      const Points::Site& s = state_.points.site[p];
      for (int axis = 0; axis < 3; ++axis) {
        if ((state_.points.bonds[p] >> (kForwardBond + axis) & 1) == 0) continue;
        const std::int32_t q = next_point(block, lane, s, axis);
        if ((known_[p] & known_[q] & kOutside) != 0) continue;
        Meeting meeting;
        if (passes(passed.edges, {place(0, p), place(0, q), place(1, p), place(1, q)}, meeting)) {
          broken.push_back(broken_bond(block, lane, q, axis, meeting));
        }
      }
    }
    return broken;
  }

 private:
  /// The point that the one in a lane holds on to along an axis.
  std::int32_t next_point(const Block& block, std::int32_t lane, const Points::Site& s,
                          int axis) const {
    if (axis == 0) return block.point[lane] + 1;  // points are numbered along x
    const int at[3] = {s.x, s.y, s.z};
    const std::int32_t in_cell =
        at[axis] % 2 == 0 ? block.point[lane + (block.stride << axis)] : -1;
    return in_cell >= 0 ? in_cell : state_.bodies[block.body].next_point(s, axis);
  }
  bool moves() const { return u_begin_ != u_end_; }
  /// Of a point at the beginning (0) or the end (1). Both ends of a bond must agree to the last bit
  /// on where a point is, or a cut exactly through it might miss the bonds on both sides.
  Vec3 place(int when, std::int32_t p) const {
    if ((known_[p] & kBrought) == 0) return far_place(when == 0 ? u_begin_ : u_end_, p);
    const float* at = &state_.places[moves() ? when : 1][3 * std::size_t(p)];
    return {at[0], at[1], at[2]};
  }
  /// Of a point that was not brought: nothing passes it.
  Vec3 far_place(const Array<float>* u, std::int32_t p) const {
    const Points::Site& s = state_.points.site[p];
    const LatticeBody& body = state_.bodies[s.body];
    Vec3 x = body.site_position(s.x, s.y, s.z);
    for (int k = 0; k < 27; ++k) {
      const int node = state_.fields->node(body, s, k);
      x += site_weight(s, k) * Vec3(u[0][node], u[1][node], u[2][node]);
    }
    return x;
  }

  /// Whether an edge passes a bond, and where the first one does.
  bool passes(const std::vector<NearEdge>& edges, const MovingSegment& bond,
              Meeting& meeting) const {
    return std::any_of(edges.begin(), edges.end(), [&](const NearEdge& near) {
      const MovingSegment then = bond.during(near.part->begin, near.part->end);
      return (one_edge_ || !stays_aside(*near.edge, then)) &&
             edge_passes(*near.edge, then, &meeting);
    });
  }

  /// The crossing in reference space, from where an edge met the bond in the world: a normal goes
  /// back by F^T.
  BrokenBond broken_bond(const Block& block, std::size_t lane, std::int32_t other, int axis,
                         const Meeting& meeting) const {
    const std::size_t column = lane % block.stride, sub = lane / block.stride % 8;
    const int cell = static_cast<int>(lane / block.stride / 8) * block.plane + block.cell[column];
    float at[3], F[9];
    for (int a = 0; a < 3; ++a) at[a] = (sub >> a & 1) != 0 ? 0.25f : -0.25f;
    BrokenBond broken{block.point[lane], other, axis, {static_cast<float>(meeting.place), {}}};
    at[axis] += 0.5f * broken.crossing.place;
    deformation_gradient_at(u_end_, CellNodes(block, cell), state_.bodies[block.body].cell_size, at,
                            F);
    Vec3 normal = Vec3::Zero();
    for (int i = 0; i < 9; ++i) normal[i % 3] += F[i] * meeting.normal[i / 3];
    const double length = normal.norm();
    for (int a = 0; a < 3; ++a) broken.crossing.normal[a] = static_cast<float>(normal[a] / length);
    if (!(length > 0 && std::isfinite(length))) broken.crossing.place = -1;
    return broken;
  }

  MpmState& state_;
  const std::vector<SweepPart> parts_;
  const bool one_edge_;  // then NearLane::outside says what stays aside
  const Array<float>*u_begin_, *u_end_;
  std::vector<std::uint8_t> known_;  // of each point: kOutside, kBrought, kNear
};

}  // namespace

void break_bonds(MpmState& state, const std::vector<BrokenBond>& broken,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  Points& points = state.points;
  std::vector<std::uint64_t> lost(points.size() / 64 + 1, 0);  // a bit of each point
  for (const BrokenBond& b : broken) {
    break_bond(kForwardBond + b.axis, points.bonds[b.point], points.bonds[b.other]);
    if (b.crossing.place >= 0) points.crossings.add(b.point, b.axis, b.crossing);
    for (const std::int32_t p : {b.point, b.other}) lost[p / 64] |= std::uint64_t{1} << (p % 64);
  }
  report.bonds_broken += static_cast<int>(broken.size());
  const std::size_t first = changed.size();
  for (std::size_t i = 0; i < lost.size(); ++i) {
    for (std::uint64_t m = lost[i]; m != 0; m &= m - 1) {
      changed.push_back(static_cast<std::int32_t>(64 * i + __builtin_ctzll(m)));
    }
  }
  report.points_separated += static_cast<int>(changed.size() - first);
}

void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, const std::vector<BlockMotion>& before,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  Sweep sweep(state, path, u_begin, u_end);
  std::vector<Sweep::Passed> passed;
  for (std::size_t i = 0; i < state.blocks.all.size(); ++i) {
    const Box& now = state.motion[i].box;
    passed.push_back(sweep.passed(*state.blocks.all[i], {now.min.cwiseMin(before[i].box.min),
                                                         now.max.cwiseMax(before[i].box.max)}));
    if (passed.back().edges.empty()) passed.pop_back();
  }
  const int count = static_cast<int>(passed.size());
  if (count == 0) return;
  const auto point_count = static_cast<std::size_t>(state.points.size());
  state.places[1].resize(3 * point_count);
  if (u_begin != u_end) state.places[0].resize(3 * point_count);
  state.cpu->for_each(count, [&](int i) { sweep.read_places(passed[i]); });
  std::vector<std::vector<BrokenBond>> of_block(count);
  state.cpu->for_each(count, [&](int i) { of_block[i] = sweep.broken_bonds(passed[i]); });
  std::vector<BrokenBond> broken;
  for (const auto& some : of_block) broken.insert(broken.end(), some.begin(), some.end());
  break_bonds(state, broken, changed, report);
}

}  // namespace tissue_sim
