// The material point method by brute force, in double precision: every point with all 27 nodes, the
// weights from the B-spline's formula, the polar decomposition from a singular value decomposition.
#pragma once

#include <Eigen/SVD>
#include <cmath>
#include <vector>

#include "mpm/mpm_state.h"

namespace tissue_sim {
namespace reference {

using Mat3 = Eigen::Matrix3d;

/// Quadratic B-spline N(r) and its derivative, r in cells.
inline double spline(double r) {
  r = std::fabs(r);
  if (r < 0.5) return 0.75 - r * r;
  return r < 1.5 ? 0.5 * (1.5 - r) * (1.5 - r) : 0.0;
}
inline double spline_slope(double r) {
  const double a = std::fabs(r);
  if (a < 0.5) return -2 * r;
  return a < 1.5 ? (r > 0 ? a - 1.5 : 1.5 - a) : 0.0;
}

/// The volume by which each point resists strain: a third of its own in a piece of at most eight
/// points that was cut off, and in a slice: where cuts left it no bond along an axis along which
/// the body went on to both sides. [m^3]
inline std::vector<double> elastic_volumes(const MpmState& s) {
  const int count = s.points.size();
  std::vector<double> volume(s.points.volume.begin(), s.points.volume.end());
  std::vector<bool> seen(count, false), soft(count, false);
  const auto next = [&](int p, int k) {
    const Points::Site at = s.points.site[p];
    const int axis = k < 3 ? 2 - k : k - 3, step = k < 3 ? -1 : 1;
    return s.bodies[at.body].point(at.x + (axis == 0 ? step : 0), at.y + (axis == 1 ? step : 0),
                                   at.z + (axis == 2 ? step : 0));
  };
  const auto bound = [&](int p, int k) { return (s.points.bonds[p] >> k & 1) != 0; };
  for (int first = 0; first < count; ++first) {
    for (int k = 0; k < 3; ++k) {
      if (!bound(first, k) && !bound(first, 5 - k) && next(first, k) >= 0 &&
          next(first, 5 - k) >= 0) {
        soft[first] = true;
      }
    }
    if (seen[first]) continue;
    std::vector<int> piece = {first};
    seen[first] = true;
    bool cut_off = false;
    for (std::size_t i = 0; i < piece.size(); ++i) {
      for (int k = 0; k < 6; ++k) {
        const int other = next(piece[i], k);
        if (!bound(piece[i], k)) {
          cut_off = cut_off || other >= 0;
          continue;
        }
        if (!seen[other]) piece.push_back(other);
        seen[other] = true;
      }
    }
    if (piece.size() > 8 || !cut_off) continue;
    for (const int p : piece) soft[p] = true;
  }
  for (int p = 0; p < count; ++p) {
    if (soft[p]) volume[p] /= 3;
  }
  return volume;
}

/// One point's stencil.
struct Stencil {
  int node[27];
  double weight[27];
  Vec3 slope[27];  // [1/m]
};

inline Stencil stencil_of(const MpmState& s, int p) {
  const Points::Site& site = s.points.site[p];
  const LatticeBody& b = s.bodies[site.body];
  const Vec3 X = b.site_position(site.x, site.y, site.z);
  Stencil result;
  for (int k = 0; k < 27; ++k) {
    const int x = site.x / 2 + k % 3 - 1, y = site.y / 2 + k / 3 % 3 - 1,
              z = site.z / 2 + k / 9 - 1;
    const Vec3 r = (X - b.node_position(x, y, z)) / b.cell_size;
    result.node[k] = s.fields->node(b, site, x, y, z);
    result.weight[k] = spline(r[0]) * spline(r[1]) * spline(r[2]);
    result.slope[k] = Vec3(spline_slope(r[0]) * spline(r[1]) * spline(r[2]),
                           spline(r[0]) * spline_slope(r[1]) * spline(r[2]),
                           spline(r[0]) * spline(r[1]) * spline_slope(r[2])) /
                      b.cell_size;
  }
  return result;
}

inline Mat3 polar_rotation(const Mat3& F) {
  const Eigen::JacobiSVD<Mat3> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

inline Mat3 piola(const Material& m, const Mat3& F) {
  const double mu = lame_mu(m), lambda = lame_lambda(m), J = F.determinant();
  Mat3 cof;
  for (int i = 0; i < 3; ++i) {
    cof.row(i) = F.row((i + 1) % 3).cross(F.row((i + 2) % 3));
  }
  if (m.law == Law::kNeoHookean) return mu * F + ((lambda + mu) * (J - 1) - mu) * cof;
  return 2 * mu * (F - polar_rotation(F)) + lambda * (J - 1) * cof;
}

/// Displacements and velocities of all nodes after one substep without contact, and what the points
/// saw on the way.
struct Step {
  std::vector<Vec3> u, v, force;
  std::vector<double> mass;
  double largest_strain = 0;  // max over points of ||F - R||
};

/// Shear modulus times volume of the points of a block in one of its partial cells [J].
inline double cell_mu(const MpmState& s, const std::vector<double>& volume, const Block& block,
                      const Block::PartialCell& cell) {
  double mu = 0;
  const int z = cell.lane / block.stride, lane = cell.lane % block.stride;
  for (int sub = 0; sub < 8; ++sub) {
    const std::int32_t p =
        block.point[(static_cast<std::size_t>(z) * 8 + sub) * block.stride + lane];
    if (p < 0) continue;
    mu += lame_mu(s.bodies[block.body].material_of(s.points, p)) * volume[p];
  }
  return mu;
}

/// The stabilising numbers (mpm/blocks/stabilisation.h) of a block's cells, each as coefficients of
/// nodes and times the root of its cell's stiffness: products of A, d, B along the axes, from their
/// definition.
inline std::vector<std::vector<std::pair<int, double>>> stabilising_rows(
    const MpmState& s, const std::vector<double>& volume, const Block& block) {
  std::vector<std::vector<std::pair<int, double>>> rows;
  const double kinds[3][3] = {{0.15625, 0.6875, 0.15625}, {-0.5, 0, 0.5}, {0.25, -0.5, 0.25}};
  const double h = s.bodies[block.body].cell_size;
  for (const Block::PartialCell& cell : block.partial) {
    const double mu = cell_mu(s, volume, block, cell);
    for (int f = 0; f < 27; ++f) {
      if (f % 3 + f / 3 % 3 + f / 9 <= 1) continue;  // linear fields are free
      rows.emplace_back();
      for (int k = 0; k < 27; ++k) {
        rows.back().emplace_back(
            block.node[cell.node + k / 9 * block.plane + k / 3 % 3 * block.pitch + k % 3],
            kinds[f % 3][k % 3] * kinds[f / 3 % 3][k / 3 % 3] * kinds[f / 9][k / 9] *
                std::sqrt(0.01 * mu) / h);
      }
    }
  }
  return rows;
}

/// Adds Kelvin-Voigt stress at the middle of each cell, or of what a cut leaves of it: its
/// gradients are the means over the eight places that points have in a cell, its viscosity times
/// volume the sum of its points', times the share of the cell that they fill.
inline void add_viscous_forces(const MpmState& s, const std::vector<double>& volume, Step& r) {
  for (const Block* block : s.blocks.all) {
    const LatticeBody& b = s.bodies[block->body];
    for (int i = 0; i < block->nz * block->stride; ++i) {
      const int z = i / block->stride, lane = i % block->stride;
      double viscosity = 0, filled = 0;  // times volume; share
      Vec3 slope[27];
      for (int k = 0; k < 27; ++k) slope[k] = Vec3::Zero();
      for (int sub = 0; sub < 8; ++sub) {
        const std::int32_t p =
            block->point[(static_cast<std::size_t>(z) * 8 + sub) * block->stride + lane];
        if (p >= 0) {
          viscosity += b.material_of(s.points, p).viscosity * volume[p];
          filled += volume[p] / std::pow(b.cell_size, 3);
        }
        double at[3];  // from the cell's node [cells]
        for (int a = 0; a < 3; ++a) at[a] = (sub >> a & 1) == 1 ? 0.25 : -0.25;
        for (int k = 0; k < 27; ++k) {
          const double x = at[0] + 1 - k % 3, y = at[1] + 1 - k / 3 % 3, z3 = at[2] + 1 - k / 9;
          slope[k] += Vec3(spline_slope(x) * spline(y) * spline(z3),
                           spline(x) * spline_slope(y) * spline(z3),
                           spline(x) * spline(y) * spline_slope(z3)) /
                      (8 * b.cell_size);
        }
      }
      if (viscosity == 0) continue;
      const std::int32_t* node = &block->node[z * block->plane + block->cell[lane]];
      const auto at = [&](int k) {
        return node[k / 9 * block->plane + k / 3 % 3 * block->pitch + k % 3];
      };
      Mat3 F = Mat3::Identity(), rate = Mat3::Zero();
      for (int k = 0; k < 27; ++k) {
        F += r.u[at(k)] * slope[k].transpose();
        rate += r.v[at(k)] * slope[k].transpose();
      }
      const Mat3 P = viscosity * filled * F * (F.transpose() * rate + rate.transpose() * F);
      for (int k = 0; k < 27; ++k) r.force[at(k)] -= P * slope[k];
    }
  }
}

inline Step substep(const MpmState& s, double dt) {
  const std::size_t n = s.nodes.size();
  Step r;
  r.u.resize(n);
  r.v.resize(n);
  r.force.assign(n, Vec3::Zero());
  r.mass.assign(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    r.u[i] = Vec3(s.nodes.u[0][i], s.nodes.u[1][i], s.nodes.u[2][i]);
    r.v[i] = Vec3(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
  }
  const std::vector<double> volume = elastic_volumes(s);
  for (int p = 0; p < s.points.size(); ++p) {
    const Material& m = s.bodies[s.points.site[p].body].material_of(s.points, p);
    const Stencil stencil = stencil_of(s, p);
    Mat3 F = Mat3::Identity();
    for (int k = 0; k < 27; ++k) F += r.u[stencil.node[k]] * stencil.slope[k].transpose();
    r.largest_strain = std::max(r.largest_strain, (F - polar_rotation(F)).norm());
    const Mat3 P = piola(m, F);
    for (int k = 0; k < 27; ++k) {
      r.force[stencil.node[k]] -= volume[p] * P * stencil.slope[k];
      r.mass[stencil.node[k]] += m.density * s.points.volume[p] * stencil.weight[k];
    }
  }
  add_viscous_forces(s, volume, r);
  for (const Block* block : s.blocks.all) {
    for (const auto& row : stabilising_rows(s, volume, *block)) {
      Vec3 value = Vec3::Zero();
      for (const auto& [i, a] : row) value += a * r.u[i];
      for (const auto& [i, a] : row) r.force[i] -= a * value;
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;  // empty or anchored
    r.v[i] += dt * (r.force[i] / r.mass[i] + s.scene.gravity);
    r.u[i] += dt * r.v[i];
  }
  return r;
}

}  // namespace reference
}  // namespace tissue_sim
