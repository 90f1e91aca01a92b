#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "mpm/fragment_features.h"
#include "mpm/lattice/bonds.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// A bond leads across a crack if at least this much of the stretch is along it: at 45 degrees it
/// is half.
constexpr double kStretchedAlong = 0.25;

/// Strained points by number, for others to be looked up: 0 where they are not strained.
struct StrainOfPoints {
  std::vector<float> excess;
  std::vector<std::uint8_t> across;
  StrainOfPoints(std::size_t count, const std::vector<StrainedPoint>& strained)
      : excess(count, 0.0f), across(count, 0) {
    for (const StrainedPoint& s : strained) {
      excess[s.point] = s.excess;
      across[s.point] = s.across;
    }
  }
};

/// Bonds without those that lead across cracks which may open: both ends are strained by `level`.
std::vector<std::uint8_t> bonds_at(const MpmState& state,
                                   const std::vector<StrainedPoint>& strained,
                                   const StrainOfPoints& of, float level) {
  std::vector<std::uint8_t> bonds(state.points.bonds.begin(), state.points.bonds.end());
  for (const StrainedPoint& s : strained) {
    if (s.excess < level) continue;
    const Points::Site& site = state.points.site[s.point];
    for (int axis = 0; axis < 3; ++axis) {
      const int k = kForwardBond + axis;
      if ((bonds[s.point] >> k & 1) == 0) continue;
      const std::int32_t q = axis == 0 ? s.point + 1  // numbered along x
                                       : state.bodies[site.body].next_point(site, axis);
      if (of.excess[q] < level) continue;
      if (((s.across | of.across[q]) >> axis & 1) != 0) break_bond(k, bonds[s.point], bonds[q]);
    }
  }
  return bonds;
}

/// That of one point in eight, its cell's first: the mean of many is the same.
void add_velocity(const MpmState& state, std::int32_t point, PieceSpread& spread) {
  const Points::Site& s = state.points.site[point];
  if (((s.x | s.y | s.z) & 1) != 0) return;
  const int n = state.fields->node(state.bodies[s.body], s, kMiddleNode);
  const double w = state.points.volume[point];
  spread.moving += w;
  spread.velocity += w * Vec3(state.nodes.v[0][n], state.nodes.v[1][n], state.nodes.v[2][n]);
}

/// Points of one row that hang together.
void add_run(const MpmState& state, const PointRun& run, bool moving, PieceSpread& spread) {
  const Points::Site& first = state.points.site[run.begin];
  const double n = run.end - run.begin;
  const Vec3 middle(first.x + 0.5 * (n - 1), first.y, first.z);
  spread.points += n;
  spread.centre += n * middle;
  spread.covariance += n * middle * middle.transpose();
  spread.covariance(0, 0) += n * (n * n - 1) / 12;
  for (std::int32_t p = run.begin; p < run.end; ++p) {
    spread.volume += state.points.volume[p];
    if (moving) add_velocity(state, p, spread);
  }
}

void finish(PieceSpread& spread) {
  if (spread.points > 0) {
    spread.centre /= spread.points;
    spread.covariance = spread.covariance / spread.points -
                        spread.centre * spread.centre.transpose() +
                        Eigen::Matrix3d::Identity() / 12;  // a point is a cube
  }
  if (spread.moving > 0) spread.velocity /= spread.moving;
}

Division divide(const MpmState& state, const std::vector<std::uint8_t>& bonds, bool moving) {
  Division d;
  d.runs = runs_along_x(bonds.data(), static_cast<std::int32_t>(bonds.size()));
  UnionFind linked = linked_runs(state, bonds.data(), d.runs);
  d.root.resize(d.runs.size());
  d.region.resize(d.runs.size());
  for (std::size_t i = 0; i < d.runs.size(); ++i) {
    d.root[i] = linked.root(static_cast<std::int32_t>(i));
    add_run(state, d.runs[i], moving, d.region[d.root[i]]);
  }
  for (PieceSpread& of : d.region) finish(of);
  return d;
}

}  // namespace

std::vector<StrainedPoint> strained_of(const MpmState& state,
                                       const std::vector<StretchedPoint>& stretched, double share) {
  std::vector<StrainedPoint> all(stretched.size());
  state.cpu->for_each(
      static_cast<int>(stretched.size()),
      [&](int i) {
        const StretchedPoint& p = stretched[i];
        const LatticeBody& body = state.bodies[state.points.site[p.point].body];
        const Material& material = body.material_of(state.points, p.point);
        if (least_tear_limit(material) == 0) return;
        Eigen::Matrix3d C;
        C << p.C[0], p.C[3], p.C[4], p.C[3], p.C[1], p.C[5], p.C[4], p.C[5], p.C[2];
        if (!C.allFinite()) return;
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
        solver.computeDirect(C, Eigen::EigenvaluesOnly);
        const double most = solver.eigenvalues()[2];
        const double excess = (std::sqrt(most) - 1) / (material.tear_stretch - 1);
        if (excess < share) return;
        std::uint8_t across = 0;
        for (int a = 0; a < 3; ++a) across |= (p.C[a] - 1 >= kStretchedAlong * (most - 1)) << a;
        all[i] = {p.point, static_cast<float>(excess), across};
      },
      256);
  all.erase(
      std::remove_if(all.begin(), all.end(), [](const StrainedPoint& p) { return p.point < 0; }),
      all.end());
  return all;
}

const PieceSpread& Division::of(std::int32_t point) const {
  const auto after =
      std::upper_bound(runs.begin(), runs.end(), point,
                       [](std::int32_t p, const PointRun& run) { return p < run.begin; });
  return region[root[after - runs.begin() - 1]];
}

FragmentSurroundings fragment_surroundings(const MpmState& state, const Pieces& pieces,
                                           std::vector<StrainedPoint> strained) {
  FragmentSurroundings around;
  around.strained = std::move(strained);
  const StrainOfPoints of_points(state.points.size(), around.strained);
  around.of_body.resize(state.bodies.size(), 0.0);
  for (const Fragment& f : pieces.all) around.of_body[f.body] += f.volume;
  state.cpu->for_each(
      kRegionLevelCount + 1,
      [&](int i) {
        if (i < kRegionLevelCount) {
          around.levels[i] =
              divide(state, bonds_at(state, around.strained, of_points, kRegionLevels[i]),
                     i == kMovingLevel);
          return;
        }
        around.pieces.resize(pieces.next_id);
        for (const PointRun& run : runs_along_x(state.points.bonds.data(),
                                                static_cast<std::int32_t>(state.points.size()))) {
          add_run(state, run, true, around.pieces[pieces.of_point[run.begin]]);
        }
        for (PieceSpread& of : around.pieces) finish(of);
      },
      1);
  return around;
}

}  // namespace tissue_sim
