#include "mpm/fragment_features.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "math/bspline.h"
#include "mpm/lattice/bonds.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Mean gradient over the eight places of a cell, of the field that one of its points sees: along
/// each axis the mean of both weights and slopes. Displacements are those from `at_rest` = 1 on.
void cell_gradient(const MpmState& state, const LatticeBody& body, const Points::Site& point,
                   const Array<float>* field, float at_rest, float* F) {
  constexpr float kWeight[3] = {kAverageSide, kAverageCenter, kAverageSide};
  constexpr float kSlope[3] = {-0.5f, 0, 0.5f};
  const auto per_cell = static_cast<float>(1 / body.cell_size);
  for (int i = 0; i < 9; ++i) F[i] = i % 4 == 0 ? at_rest : 0.0f;
  for (int k = 0; k < 27; ++k) {
    const int d[3] = {k % 3, k / 3 % 3, k / 9}, node = state.fields->node(body, point, k);
    for (int b = 0; b < 3; ++b) {
      const float slope =
          per_cell * kSlope[d[b]] * kWeight[d[(b + 1) % 3]] * kWeight[d[(b + 2) % 3]];
      for (int a = 0; a < 3; ++a) F[3 * a + b] += slope * field[a][node];
    }
  }
}

/// The points of the cell that a site is in, -1 where there is none.
void points_of_cell(const LatticeBody& body, int x, int y, int z, std::int32_t (&points)[8]) {
  for (int i = 0; i < 8; ++i) {
    points[i] = body.point((x & ~1) + (i & 1), (y & ~1) + (i >> 1 & 1), (z & ~1) + (i >> 2));
  }
}

/// Volume of the points that there are, as a share of a full cell's.
float share_of_cell(const MpmState& state, const LatticeBody& body,
                    const std::int32_t (&points)[8]) {
  double volume = 0;
  for (const std::int32_t p : points) volume += p < 0 ? 0 : state.points.volume[p];
  return static_cast<float>(volume / (body.cell_size * body.cell_size * body.cell_size));
}

}  // namespace

void fragment_features(const MpmState& state, std::int32_t point, float* x) {
  const Points::Site& s = state.points.site[point];
  const LatticeBody& body = state.bodies[s.body];
  std::int32_t own[8];
  points_of_cell(body, s.x, s.y, s.z, own);
  cell_gradient(state, body, s, state.nodes.u, 1, x);
  x[9] = share_of_cell(state, body, own);
  for (int neighbour = 1; neighbour < kFeatureCells; ++neighbour) {
    float* of_cell = x + neighbour * kFeaturesOfCell;
    for (int i = 0; i < kFeaturesOfCell; ++i) of_cell[i] = i < 9 && i % 4 == 0 ? 1.0f : 0.0f;
    const int axis = (neighbour - 1) / 2, forward = (neighbour - 1) % 2;
    const int bond = forward != 0 ? kForwardBond + axis : opposite_bond(kForwardBond + axis);
    const BondOffset o = bond_offset(bond);
    std::int32_t other[8];
    points_of_cell(body, s.x + 2 * o.x, s.y + 2 * o.y, s.z + 2 * o.z, other);
    // Bonds lead from the side of the own cell that faces the other one.
    int bonds = 0, whole = 0;
    for (int i = 0; i < 8; ++i) {
      if ((i >> axis & 1) != forward || own[i] < 0 || other[i ^ 1 << axis] < 0) continue;
      ++bonds;
      whole += state.points.bonds[own[i]] >> bond & 1;
    }
    if (whole == 0) continue;
    const int place = (s.x & 1) + 2 * (s.y & 1) + 4 * (s.z & 1);
    std::int32_t seen = other[place];
    for (int i = 0; i < 8 && seen < 0; ++i) seen = other[i];
    cell_gradient(state, body, state.points.site[seen], state.nodes.u, 1, of_cell);
    of_cell[9] = share_of_cell(state, body, other) * static_cast<float>(whole) / bonds;
  }
}

namespace {

/// Stretches of a cell, smallest first, and the direction of the largest.
struct Stretches {
  Vec3 lambda, direction;
  Eigen::Matrix3d F;
  explicit Stretches(const float* f) {
    for (int i = 0; i < 9; ++i) F(i / 3, i % 3) = f[i];
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(F.transpose() * F);
    lambda = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
    direction = solver.eigenvectors().col(2);
  }
};

/// Broken bonds among the points of a cell, as a share of those that there were.
float broken_inside(const MpmState& state, const std::int32_t (&own)[8]) {
  int bonds = 0, broken = 0;
  for (int i = 0; i < 8; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if ((i >> axis & 1) != 0 || own[i] < 0 || own[i | 1 << axis] < 0) continue;
      ++bonds;
      broken += (state.points.bonds[own[i]] >> (kForwardBond + axis) & 1) == 0;
    }
  }
  return bonds > 0 ? static_cast<float>(broken) / bonds : 0.0f;
}

float share_broken(const MpmState& state, const std::int32_t (&own)[8], int neighbour) {
  const int axis = (neighbour - 1) / 2, forward = (neighbour - 1) % 2;
  const int bond = forward != 0 ? kForwardBond + axis : opposite_bond(kForwardBond + axis);
  int bonds = 0, broken = 0;
  for (int i = 0; i < 8; ++i) {
    if ((i >> axis & 1) != forward || own[i] < 0) continue;
    const int there = state.whole_bonds[own[i]] >> bond & 1;
    bonds += there;
    broken += there != 0 && (state.points.bonds[own[i]] >> bond & 1) == 0;
  }
  return bonds > 0 ? static_cast<float>(broken) / bonds : 0.0f;
}

}  // namespace

void surrounding_features(const MpmState& state, const Pieces& pieces,
                          const FragmentSurroundings& around, std::int32_t point, float* x) {
  using namespace surroundings;
  std::fill(x + kFeatureCount, x + kAllFeatureCount, 0.0f);
  const Points::Site& s = state.points.site[point];
  const LatticeBody& body = state.bodies[s.body];
  std::int32_t own[8];
  points_of_cell(body, s.x, s.y, s.z, own);
  const double bears = body.material_of(state.points, point).tear_stretch - 1;
  Vec3 direction = Vec3::Zero();
  for (int cell = 0; cell < kFeatureCells; ++cell) {
    if (x[cell * kFeaturesOfCell + 9] == 0) continue;
    const Stretches stretches(x + cell * kFeaturesOfCell);
    x[kExcess + cell] = static_cast<float>((stretches.lambda[2] - 1) / bears);
    if (cell > 0) continue;
    direction = stretches.direction;
    x[kOther] = static_cast<float>((stretches.lambda[1] - 1) / bears);
    x[kOther + 1] = static_cast<float>((stretches.lambda[0] - 1) / bears);
    float rate[9];
    cell_gradient(state, body, s, state.nodes.v, 0, rate);
    Eigen::Matrix3d of_F;
    for (int i = 0; i < 9; ++i) of_F(i / 3, i % 3) = rate[i];
    const double of_stretch =
        (stretches.F * direction).dot(of_F * direction) / std::max(0.1, stretches.lambda[2]);
    const double c = wave_speed(body.material_of(state.points, point));
    x[kRate] = static_cast<float>(of_stretch * body.cell_size / c / bears);
  }
  x[kBrokenInside] = broken_inside(state, own);
  for (int n = 1; n < kFeatureCells; ++n) x[kBroken + n - 1] = share_broken(state, own, n);

  const double of_body = around.of_body[s.body], cell = std::pow(body.cell_size, 3);
  for (int level = 0; level < kRegionLevelCount; ++level) {
    const double volume = around.levels[level].of(point).volume;
    x[kRegion + 2 * level] = static_cast<float>(volume / of_body);
    x[kRegion + 2 * level + 1] = static_cast<float>(0.25 * std::log1p(volume / cell));
  }
  const PieceSpread& piece = around.pieces[pieces.of_point[point]];
  x[kPiece] = static_cast<float>(piece.volume / of_body);
  const Vec3 from_centre = Vec3(s.x, s.y, s.z) - piece.centre;
  const auto deviations = [&](const Vec3& along) {
    return along.dot(from_centre) / std::sqrt(along.dot(piece.covariance * along));
  };
  Vec3 gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const auto excess = [&](int cell) {
      return x[cell * kFeaturesOfCell + 9] > 0 ? x[kExcess + cell] : x[kExcess];
    };
    gradient[axis] = excess(2 + 2 * axis) - excess(1 + 2 * axis);
  }
  if (gradient.norm() > 1e-6) {
    x[kAlongGradient] = static_cast<float>(deviations(gradient.normalized()));
    const double sign = direction.dot(gradient) < 0 ? -1 : 1;
    x[kAlongStretch] = static_cast<float>(deviations(sign * direction));
  }
  x[kFromCentre] = static_cast<float>(
      std::sqrt(std::max(0.0, from_centre.dot(piece.covariance.ldlt().solve(from_centre)))));
  const PieceSpread& region = around.levels[kMovingLevel].of(point);
  const double c = wave_speed(body.material_of(state.points, point)) * bears;
  if (region.moving == 0 || piece.moving == 0) return;
  const Vec3 relative = region.velocity - piece.velocity;
  x[kSpeed] = static_cast<float>(relative.norm() / c);
  // Reference space is the world turned by F, about.
  const Vec3 away = Stretches(x).F * (region.centre - piece.centre);
  if (away.norm() > 1e-6) x[kParting] = static_cast<float>(relative.dot(away.normalized()) / c);
}

FragmentCandidates fragment_candidates(const MpmState& state, const Pieces& pieces,
                                       const std::vector<StrainedPoint>& strained) {
  std::vector<std::uint8_t> loose(pieces.next_id, 0);
  for (const Fragment& f : pieces.all) loose[f.id] = f.loose;
  struct Seen {
    std::int32_t node, point;
  };
  std::vector<Seen> seen;
  for (const StrainedPoint& s : strained) {
    const bool broken = state.points.bonds[s.point] != state.whole_bonds[s.point];
    if (s.excess < (broken ? kCandidateAtCrack : kCandidateShare)) continue;
    if (state.points.anchored[s.point] != 0 || loose[pieces.of_point[s.point]] != 0) continue;
    const Points::Site& site = state.points.site[s.point];
    seen.push_back({state.fields->node(state.bodies[site.body], site, kMiddleNode), s.point});
  }
  std::sort(seen.begin(), seen.end(), [](const Seen& a, const Seen& b) {
    return a.node != b.node ? a.node < b.node : a.point < b.point;
  });
  FragmentCandidates candidates;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (i == 0 || seen[i].node != seen[i - 1].node) {
      candidates.first.push_back(static_cast<std::int32_t>(i));
    }
    candidates.points.push_back(seen[i].point);
  }
  candidates.first.push_back(static_cast<std::int32_t>(seen.size()));
  return candidates;
}

}  // namespace tissue_sim
