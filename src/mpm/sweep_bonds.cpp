#include <algorithm>
#include <cmath>
#include <utility>

#include "compute/eight_bytes.h"
#include "cutting/blade_sweep.h"
#include "mpm/cut_tissue.h"
#include "mpm/lattice/bonds.h"
#include "mpm/split/front.h"
#include "mpm/split/near_sweep.h"
#include "mpm/surface/facet_motion.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

// Points within this many cells are brought: few bonds of those that are looked at end elsewhere.
constexpr double kBringReach = 2 * kSweepReach;
static_assert(kBringReach >= kRimReach, "points near the rim's bonds are known");

// Of a path of so many edges it is noted what is outside of each of them; a scalpel has two.
constexpr std::size_t kNotedEdges = 4;

/// What is known of where a point is: whether it was brought, whether it is near an edge, and
/// whether it is at least within kBringReach of one.
constexpr unsigned kBeside = 0x20, kBrought = 0x40, kNear = 0x80;

/// Sweeps one path through all tissue.
class Sweep {
 public:
  Sweep(MpmState& state, const BladePath& path, const Array<float>* u_begin,
        const Array<float>* u_end)
      : state_(state), parts_(sweep_parts(path)), u_begin_(u_begin), u_end_(u_end) {
    for (const SweepPart& part : parts_) {
      for (const SweptEdge& edge : part.edges) edges_.push_back({&part, &edge, edges_.size()});
    }
  }

  /// Lists the blocks that the path passes; `before` as in sweep_bonds(). Returns how many.
  int list_blocks(const std::vector<BlockMotion>& before) {
    const double reach = kBringReach * state_.scene.cell_size;
    for (std::size_t i = 0; i < state_.blocks.all.size(); ++i) {
      stop_if_asked();
      const Box& now = state_.motion[i].box;
      const Box box{now.min.cwiseMin(before[i].box.min), now.max.cwiseMax(before[i].box.max)};
      PassedBlock passed{state_.blocks.all[i], {}, {}, {}};
      for (const PathEdge& edge : edges_) {
        const unsigned outside = outside_of(*edge.swept, box, reach);
        if (outside == 0) passed.edges.push_back(edge);
        if (edge.number < kNotedEdges) {
          passed.outside[edge.number] = static_cast<std::uint8_t>(outside);
        }
      }
      if (!passed.edges.empty()) passed_.push_back(std::move(passed));
    }
    if (!passed_.empty()) {
      known_.assign(state_.points.size(), 0);
      if (edges_.size() <= kNotedEdges) outside_.assign(edges_.size(), known_);
      // Without values: it is large, and most points are not near.
      if (!state_.work.swept) state_.work.swept.reset(new SweptPoint[state_.points.size()]);
    }
    return static_cast<int>(passed_.size());
  }

  /// Finds out where the points of the i-th of these blocks are.
  void read_places(int i) {
    PassedBlock& passed = passed_[i];
    const Block& block = *passed.block;
    BlockScratch& scratch = state_.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 6 * lanes) scratch.values.resize(6 * lanes);
    if (scratch.near.size() < lanes) scratch.near.resize(lanes);
    float *end = scratch.values.data(), *begin = u_begin_ != u_end_ ? end + 3 * lanes : end;
    const BlockField field = block_field(state_, block);
    state_.kernels->positions(block, field, u_end_, scratch, end);
    if (begin != end) state_.kernels->positions(block, field, u_begin_, scratch, begin);
    const auto reach = static_cast<float>(kSweepReach * state_.scene.cell_size);
    for (const PathEdge& edge : passed.edges) {
      LaneSlab slabs[3];
      for (int k = 0; k < 3; ++k) {
        const Slab& s = edge.swept->slabs[k];
        slabs[k] = {
            {float(s.axis[0]), float(s.axis[1]), float(s.axis[2])}, float(s.low), float(s.high)};
      }
      // Bonds from points that are near an edge lead to points that are not far.
      const bool alone = passed.edges.size() == 1 && !outside_.empty();
      const int count = state_.kernels->lanes_near(slabs, {2 * reach, reach, 0.01f * reach}, begin,
                                                   end, lanes, scratch.near.data());
      passed.points.reserve(count);
      for (int k = 0; k < count; ++k) {
        const NearLane& near = scratch.near[k];
        const std::int32_t p = block.point[near.lane];
        if (p < 0) continue;
        std::uint8_t& known = known_[p];
        known |= near.near ? kNear | kBeside : kBeside;
        for (std::size_t e = 0; e < outside_.size(); ++e) {
          outside_[e][p] = e == edge.number ? near.outside : passed.outside[e];
        }
        if ((known & kBrought) != 0 || (alone && !near.near)) continue;
        known |= kBrought;
        state_.work.swept[p] = {i, static_cast<std::int32_t>(passed.points.size())};
        const float *b = begin + near.lane, *e = end + near.lane;
        passed.points.push_back(
            {near.lane, {{b[0], b[lanes], b[2 * lanes]}, {e[0], e[lanes], e[2 * lanes]}}});
      }
    }
    if (passed.edges.size() == 1 || outside_.empty()) return;
    for (const NearPoint& point : passed.points) {
      for (const PathEdge& edge : passed.edges) {
        outside_[edge.number][block.point[point.lane]] =
            outside_of(*edge.swept, point, 0.01 * reach);
      }
    }
  }

  /// By point: 0 for those farther than kBringReach from all edges.
  const std::uint8_t* known() const { return known_.data(); }

  /// The bonds that point forward from the points of a layer across z and that the path passes.
  std::vector<BrokenBond> broken_bonds(const LatticeBody& body, int z) const {
    std::vector<Bond> bonds;
    for (int y = 0; y < 2 * body.ny; ++y) {
      body.for_each_point_in_row(0, 2 * body.nx, y, z, [&](int x, int point, int count) {
        if (!any_near(point, count)) return;
        add_near(point, point + 1, count - 1, 0, bonds);
        for (int axis = 1; axis < 3; ++axis) {
          body.for_each_point_in_row(x, x + count, y + (axis == 1), z + (axis == 2),
                                     [&](int beside, int other, int n) {
                                       add_near(point + beside - x, other, n, axis, bonds);
                                     });
        }
      });
    }
    std::vector<BrokenBond> broken;
    broken.reserve(bonds.size());
    const std::size_t count = bonds.size();
    for (std::size_t i = 0; i < count; ++i) {
      // Places lie scattered and come from far: they are on their way while others are worked on.
      if (i + 16 < count) {
        __builtin_prefetch(&state_.work.swept[bonds[i + 16].point]);
        __builtin_prefetch(&state_.work.swept[bonds[i + 16].other]);
      }
      if (i + 8 < count) {
        prefetch_place(bonds[i + 8].point);
        prefetch_place(bonds[i + 8].other);
      }
      add_broken(bonds[i], broken);
    }
    return broken;
  }

 private:
  /// A block that is near edges of the path, its points that are, and where it lies beside others.
  struct PassedBlock {
    const Block* block;
    std::vector<PathEdge> edges;
    std::vector<NearPoint> points;
    std::uint8_t outside[kNotedEdges];
  };
  /// From a point to its neighbour along an axis.
  struct Bond {
    std::int32_t point, other;
    int axis;
  };

  bool any_near(std::int32_t point, int count) const {
    std::uint64_t near = 0;
    for (int i = 0; i < count; i += 8) near |= bytes_of(known_, point + i, count - i);
    return (near & eight(kNear)) != 0;
  }
  /// Adds those bonds from `count` points to as many others, neighbours along an axis, that the
  /// path may pass. Eight at a time: whether the first is near and they are not both to one side.
  void add_near(std::int32_t point, std::int32_t other, int count, int axis,
                std::vector<Bond>& bonds) const {
    for (int i = 0; i < count; i += 8) {
      const auto bytes = [i, count](const auto& of, std::int32_t first) {
        return bytes_of(of, first + i, count - i);
      };
      std::uint64_t left = bytes(known_, point) & eight(kNear);
      if (left == 0) continue;
      left &= bytes(state_.points.bonds, point) << (7 - kForwardBond - axis);
      std::uint64_t aside = outside_.empty() ? 0 : left;  // of all edges
      for (const std::vector<std::uint8_t>& outside : outside_) {
        aside &= (bytes(outside, point) & bytes(outside, other)) + eight(0x7f);
      }
      left &= ~aside;
      for (; left != 0; left &= left - 1) {
        const std::int32_t p = point + i + __builtin_ctzll(left) / 8;
        bonds.push_back({p, p + other - point, axis});
      }
    }
  }
  void prefetch_place(std::int32_t p) const {
    if ((known_[p] & kBrought) == 0) return;
    const SweptPoint& swept = state_.work.swept[p];
    __builtin_prefetch(&passed_[swept.block].points[swept.index]);
  }
  /// Adds a bond if the path passes it.
  void add_broken(const Bond& bond, std::vector<BrokenBond>& broken) const {
    const std::int32_t p = bond.point, q = bond.other;
    const PassedBlock& passed = passed_[state_.work.swept[p].block];
    Meeting meeting;
    if (!passes(passed.edges, {place(0, p), place(0, q), place(1, p), place(1, q)}, meeting))
      return;
    const std::int32_t lane = passed.points[state_.work.swept[p].index].lane;
    broken.push_back(broken_bond(*passed.block, lane, q, bond.axis, meeting));
  }

  /// Of a point at the beginning (0) or the end (1). Both ends of a bond must agree to the last bit
  /// on where a point is, or a cut exactly through it might miss the bonds on both sides.
  Vec3 place(int when, std::int32_t p) const {
    if ((known_[p] & kBrought) == 0) return far_place(when == 0 ? u_begin_ : u_end_, p);
    const SweptPoint& swept = state_.work.swept[p];
    const float* at = passed_[swept.block].points[swept.index].at[when];
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
  static bool passes(const std::vector<PathEdge>& edges, const MovingSegment& bond,
                     Meeting& meeting) {
    return std::any_of(edges.begin(), edges.end(), [&](const PathEdge& edge) {
      const MovingSegment then = bond.during(edge.part->begin, edge.part->end);
      return !stays_aside(*edge.swept, then) && edge_passes(*edge.swept, then, &meeting);
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
  std::vector<PathEdge> edges_;
  const Array<float>*u_begin_, *u_end_;
  std::vector<PassedBlock> passed_;
  std::vector<std::uint8_t> known_;  // of each point: kBrought, kNear
  // Of each edge and point NearLane's `outside`, as far as points are brought; empty of many edges.
  std::vector<std::vector<std::uint8_t>> outside_;
};

}  // namespace

void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, const std::vector<BlockMotion>& before,
                 std::vector<std::int32_t>& changed, std::vector<std::int32_t>& touched,
                 CutReport& report) {
  Sweep sweep(state, path, u_begin, u_end);
  const int passed = sweep.list_blocks(before);
  if (passed == 0) return;
  const WorkLimits limits = work_limits();
  state.cpu->for_each(passed, [&](int i) {
    stop_if_asked(limits);
    sweep.read_places(i);
  });
  std::vector<std::pair<const LatticeBody*, int>> layers;
  for (const LatticeBody& b : state.bodies) {
    for (int z = 0; z < 2 * b.nz; ++z) layers.emplace_back(&b, z);
  }
  const int count = static_cast<int>(layers.size());
  std::vector<std::vector<BrokenBond>> broken(count);
  state.cpu->for_each(count + 1, [&](int i) {
    if (i == 0) {  // what a thread would be alone with when bonds break
      state.points.crossings.reserve(state.points.size());
    } else {
      stop_if_asked(limits);
      broken[i - 1] = sweep.broken_bonds(*layers[i - 1].first, layers[i - 1].second);
    }
  });
  break_bonds(state, broken, changed, report);
  pass_rim(state, path, u_begin, u_end, changed, sweep.known(), touched);
}

}  // namespace tissue_sim
