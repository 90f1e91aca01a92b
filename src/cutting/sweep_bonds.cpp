#include <algorithm>
#include <cmath>

#include "contact/facet_motion.h"
#include "cutting/blade_sweep.h"
#include "cutting/bonds.h"
#include "cutting/cut_tissue.h"

namespace tissue_sim {
namespace {

// A sweep looks at points within this many cells, and at blocks within twice as many, so that a
// bond is seen as long as it is not stretched to three times its length.
constexpr double kReach = 1.5;

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

/// Lowers each lane's `distance` to that from what an edge sweeps, at least. `x` and `y` are its
/// places at the beginning and the end, [3][lanes].
void lower_distance(const SweptEdge& edge, const float* x, const float* y, std::size_t lanes,
                    float* distance) {
  struct {
    float x, y, z, low, high;
  } slabs[3];
  for (int i = 0; i < 3; ++i) {
    const Slab& s = edge.slabs[i];
    slabs[i] = {float(s.axis[0]), float(s.axis[1]), float(s.axis[2]), float(s.low), float(s.high)};
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    float farthest = 0;
    for (const auto& s : slabs) {
      const float a = s.x * x[lane] + s.y * x[lanes + lane] + s.z * x[2 * lanes + lane];
      const float b = s.x * y[lane] + s.y * y[lanes + lane] + s.z * y[2 * lanes + lane];
      const float below = s.low - (a > b ? a : b), above = (a > b ? b : a) - s.high;
      farthest = below > farthest ? below : farthest;
      farthest = above > farthest ? above : farthest;
    }
    distance[lane] = farthest < distance[lane] ? farthest : distance[lane];
  }
}

/// Sweeps one path through one block at a time.
class Sweep {
 public:
  Sweep(MpmState& state, const BladePath& path, const Array<float>* u_begin,
        const Array<float>* u_end)
      : state_(state), parts_(sweep_parts(path)), u_begin_(u_begin), u_end_(u_end) {}

  /// A block that is near edges of the path, and the lanes that are.
  struct Passed {
    const Block* block;
    std::vector<NearEdge> edges;
    std::vector<std::int32_t> lanes;
  };
  /// `box` is the block's, from the beginning to the end.
  Passed passed(const Block& block, const Box& box) const {
    const double reach = 2 * kReach * state_.scene.cell_size;
    Passed result{&block, {}, {}};
    for (const SweepPart& part : parts_) {
      for (const SweptEdge& edge : part.edges) {
        if (is_near(box, edge, reach)) result.edges.push_back({&part, &edge});
      }
    }
    return result;
  }

  /// Fills MpmState::places for a block's points and lists the lanes near the sweep.
  void read_places(Passed& passed) const {
    const Block& block = *passed.block;
    BlockScratch& scratch = state_.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 7 * lanes) scratch.values.resize(7 * lanes);
    float *end = scratch.values.data(), *begin = moves() ? end + 3 * lanes : end,
          *distance = end + 6 * lanes;
    const BlockField field = block_field(state_, block);
    state_.kernels->positions(block, field, u_end_, scratch, end);
    if (moves()) state_.kernels->positions(block, field, u_begin_, scratch, begin);
    std::fill_n(distance, lanes, 1e30f);
    for (const NearEdge& near : passed.edges) {
      lower_distance(*near.edge, begin, end, lanes, distance);
    }
    const float reach = static_cast<float>(kReach * state_.scene.cell_size);
    float *at_begin = state_.places[0].data(), *at_end = state_.places[1].data();
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      for (int a = 0; a < 3; ++a) at_end[3 * std::size_t(p) + a] = end[a * lanes + lane];
      for (int a = 0; moves() && a < 3; ++a) {
        at_begin[3 * std::size_t(p) + a] = begin[a * lanes + lane];
      }
      if (distance[lane] <= reach) passed.lanes.push_back(static_cast<std::int32_t>(lane));
    }
  }

  /// A forward bond that an edge passed, and where, if that can be said.
  struct Broken {
    std::int32_t point;
    int axis;
    bool has_crossing;
    Crossing crossing;
  };
  /// The bonds that point forward from the block's points and that the path passes.
  std::vector<Broken> broken_bonds(const Passed& passed) const {
    std::vector<Broken> broken;
    const Block& block = *passed.block;
    const LatticeBody& body = state_.bodies[block.body];
    for (const std::int32_t lane : passed.lanes) {
      const std::int32_t p = block.point[lane];
      const Points::Site& s = state_.points.site[p];
      const Vec3 p0 = place(0, p), p1 = place(1, p);
      for (int axis = 0; axis < 3; ++axis) {
        if ((state_.points.bonds[p] >> (kForwardBond + axis) & 1) == 0) continue;
        const std::int32_t q = body.next_point(s, axis);
        Meeting meeting;
        if (passes(passed.edges, {p0, place(0, q), p1, place(1, q)}, meeting)) {
          broken.push_back(broken_bond(block, lane, axis, meeting));
        }
      }
    }
    return broken;
  }

 private:
  bool moves() const { return u_begin_ != u_end_; }
  /// Of a point at the beginning (0) or the end (1). Both ends of a bond must agree to the last bit
  /// on where a point is, or a cut exactly through it might miss the bonds on both sides.
  Vec3 place(int when, std::int32_t p) const {
    const float* at = &state_.places[moves() ? when : 1][3 * std::size_t(p)];
    return {at[0], at[1], at[2]};
  }

  /// Whether an edge passes a bond, and where the first one does.
  static bool passes(const std::vector<NearEdge>& edges, const MovingSegment& bond,
                     Meeting& meeting) {
    const Vec3 a = bond.a1 - bond.a0, b = bond.b1 - bond.b0;
    return std::any_of(edges.begin(), edges.end(), [&](const NearEdge& near) {
      const double begin = near.part->begin, end = near.part->end;
      const MovingSegment then{bond.a0 + begin * a, bond.b0 + begin * b, bond.a0 + end * a,
                               bond.b0 + end * b};
      return !stays_aside(*near.edge, then) && edge_passes(*near.edge, then, &meeting);
    });
  }

  /// The crossing in reference space, from where an edge met the bond in the world: a normal goes
  /// back by F^T.
  Broken broken_bond(const Block& block, std::size_t lane, int axis, const Meeting& meeting) const {
    const std::size_t column = lane % block.stride, sub = lane / block.stride % 8;
    const int cell = static_cast<int>(lane / block.stride / 8) * block.plane + block.cell[column];
    float at[3], F[9];
    for (int a = 0; a < 3; ++a) at[a] = (sub >> a & 1) != 0 ? 0.25f : -0.25f;
    Broken broken{block.point[lane], axis, false, {static_cast<float>(meeting.place), {}}};
    at[axis] += 0.5f * broken.crossing.place;
    deformation_gradient_at(u_end_, CellNodes(block, cell), state_.bodies[block.body].cell_size, at,
                            F);
    Vec3 normal = Vec3::Zero();
    for (int i = 0; i < 9; ++i) normal[i % 3] += F[i] * meeting.normal[i / 3];
    const double length = normal.norm();
    broken.has_crossing = length > 0 && std::isfinite(length);
    for (int a = 0; a < 3; ++a) broken.crossing.normal[a] = static_cast<float>(normal[a] / length);
    return broken;
  }

  MpmState& state_;
  const std::vector<SweepPart> parts_;
  const Array<float>*u_begin_, *u_end_;
};

}  // namespace

void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, const std::vector<BlockMotion>& before,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  const Sweep sweep(state, path, u_begin, u_end);
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
  std::vector<std::vector<Sweep::Broken>> broken(count);
  state.cpu->for_each(count, [&](int i) { broken[i] = sweep.broken_bonds(passed[i]); });
  Points& points = state.points;
  std::vector<std::uint64_t> lost(points.size() / 64 + 1, 0);  // a bit of each point
  for (const auto& of_block : broken) {
    for (const Sweep::Broken& b : of_block) {
      const Points::Site& s = points.site[b.point];
      const std::int32_t q = state.bodies[s.body].next_point(s, b.axis);
      break_bond(kForwardBond + b.axis, points.bonds[b.point], points.bonds[q]);
      if (b.has_crossing) points.crossings.add(b.point, b.axis, b.crossing);
      for (const std::int32_t p : {b.point, q}) lost[p / 64] |= std::uint64_t{1} << (p % 64);
    }
    report.bonds_broken += static_cast<int>(of_block.size());
  }
  const std::size_t first = changed.size();
  for (std::size_t i = 0; i < lost.size(); ++i) {
    for (std::uint64_t m = lost[i]; m != 0; m &= m - 1) {
      changed.push_back(static_cast<std::int32_t>(64 * i + __builtin_ctzll(m)));
    }
  }
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim
