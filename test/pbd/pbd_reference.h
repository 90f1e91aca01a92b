// A step of position-based dynamics in double precision, constraint by constraint, with none of the
// package's projections: gradients are differences.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace reference {

struct PbdPlaces {
  std::vector<Vec3> x;
  std::vector<double> w;  ///< 1 / mass, 0 where held
};

inline PbdPlaces pbd_places(const pbd::State& s) {
  PbdPlaces p;
  for (int i = 0; i < s.vertices.size(); ++i) {
    p.x.push_back(s.vertices.position(i));
    p.w.push_back(s.vertices.x[4 * i + 3]);
  }
  return p;
}

using Corners = std::vector<Vec3>;
using Constraint = std::function<double(const Corners&)>;

inline std::vector<Vec3> gradient(const Constraint& c, Corners at, double step) {
  std::vector<Vec3> g(at.size());
  for (std::size_t i = 0; i < at.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      const double was = at[i][a];
      at[i][a] = was + step;
      const double up = c(at);
      at[i][a] = was - step;
      g[i][a] = (up - c(at)) / (2 * step);
      at[i][a] = was;
    }
  }
  return g;
}

/// How far a projection moves for a change of its multiplier: sum of w |g|^2.
template <class Vertices>
double mobility_of(const PbdPlaces& p, const Vertices& vertices, const std::vector<Vec3>& g) {
  double sum = 0;
  for (std::size_t i = 0; i < g.size(); ++i) sum += p.w[vertices[i]] * g[i].squaredNorm();
  return sum;
}

/// XPBD: dlambda = -(C + a lambda) / (sum w |g|^2 + a), times `share`.
template <class Vertices>
void project(PbdPlaces& p, const Vertices& vertices, double c, const std::vector<Vec3>& g, double a,
             double share, double& lambda) {
  const double sum = a + mobility_of(p, vertices, g);
  if (!(sum > 0)) return;
  const double change = -share * (c + a * lambda) / sum;
  lambda += change;
  for (std::size_t i = 0; i < g.size(); ++i) p.x[vertices[i]] += p.w[vertices[i]] * change * g[i];
}

template <class Vertices>
Corners corners_of(const PbdPlaces& p, const Vertices& vertices) {
  Corners at;
  for (const auto v : vertices) at.push_back(p.x[v]);
  return at;
}

template <class Numbers>
Eigen::Matrix3d inverse_rest(const Numbers& n) {
  Eigen::Matrix3d q;
  q << n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8];
  return q;
}
inline Eigen::Matrix3d deformation(const Corners& at, const Eigen::Matrix3d& q) {
  Eigen::Matrix3d p;
  for (int k = 0; k < 3; ++k) p.col(k) = at[k + 1] - at[0];
  return p * q;
}

/// Calls project(c, lambdas of c) in the order of colours, or backward.
template <class Kind, class F>
void each_constraint(const pbd::ConstraintSet<Kind>& set, std::vector<std::array<double, 2>>& all,
                     bool backward, const F& project) {
  all.resize(set.size(), {0, 0});
  int colours = 0;
  for (const auto c : set.colour) colours = std::max<int>(colours, c + 1);
  for (int k = 0; k < colours; ++k) {
    const int colour = backward ? colours - 1 - k : k;
    for (int c = 0; c < set.size(); ++c) {
      if (set.colour[c] == colour) project(c, all[c]);
    }
  }
}

/// Multipliers of each constraint.
struct PbdMultipliers {
  std::vector<std::array<double, 2>> elastics, strains, links, bends;
};

inline void project_constraints(const pbd::State& s, double h, PbdPlaces& p, PbdMultipliers& m,
                                bool once = true, bool backward = false) {
  const double inverse_h2 = 1 / (h * h);
  const auto elastics = [&] {
    each_constraint(s.elastics, m.elastics, backward, [&](int c, std::array<double, 2>& lambda) {
      const auto& vertices = s.elastics.vertices[c];
      const auto& n = s.elastics.numbers[c];
      const Eigen::Matrix3d q = inverse_rest(n);
      Eigen::Matrix3d f = deformation(corners_of(p, vertices), q);
      const double j = std::min(4.0, std::max(0.1, f.determinant()));
      Eigen::Matrix3d cof;
      for (int k = 0; k < 3; ++k) cof.col(k) = f.col((k + 1) % 3).cross(f.col((k + 2) % 3));
      const Eigen::Matrix3d along = f - cof / std::cbrt(j);
      const double cd = std::sqrt(0.5 * along.squaredNorm() + 1e-20);
      const Eigen::Matrix3d of_edges = along / cd * q.transpose();
      const std::vector<Vec3> g = {-of_edges.rowwise().sum(), of_edges.col(0), of_edges.col(1),
                                   of_edges.col(2)};
      double a = n[9] * inverse_h2;
      if (once) {  // what one projection softens
        a = std::max(a - pbd::Elastic::kSoftened * mobility_of(p, vertices, g),
                     pbd::Elastic::kLeastCompliance * a);
      }
      project(p, vertices, cd, g, a, 1, lambda[0]);
      const Constraint volume = [&](const Corners& at) {
        return deformation(at, q).determinant() - 1;
      };
      const Corners at = corners_of(p, vertices);
      project(p, vertices, volume(at), gradient(volume, at, 1e-8), n[10] * inverse_h2, 1,
              lambda[1]);
    });
  };
  const auto strains = [&] {
    each_constraint(s.strains, m.strains, backward, [&](int c, std::array<double, 2>&) {
      const auto& vertices = s.strains.vertices[c];
      const auto& n = s.strains.numbers[c];
      const Eigen::Matrix3d q = inverse_rest(n);
      constexpr int kPairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
      for (const auto& ij : kPairs) {
        const bool is_stretch = ij[0] == ij[1];
        const Constraint strain = [&](const Corners& at) {
          const Eigen::Matrix3d f = deformation(at, q);
          return f.col(ij[0]).dot(f.col(ij[1])) - (is_stretch ? 1 : 0);
        };
        const Corners at = corners_of(p, vertices);
        double none = 0;
        project(p, vertices, strain(at), gradient(strain, at, 1e-8), 0, is_stretch ? n[9] : n[10],
                none);
      }
    });
  };
  const auto links = [&] {
    each_constraint(s.links, m.links, backward, [&](int c, std::array<double, 2>& lambda) {
      const auto& vertices = s.links.vertices[c];
      const auto& n = s.links.numbers[c];
      const Corners at = corners_of(p, vertices);
      const Vec3 way = (at[1] - at[0]).normalized();
      project(p, vertices, (at[1] - at[0]).norm() - n[0], {-way, way}, n[1] * inverse_h2, 1,
              lambda[0]);
    });
  };
  const auto bends = [&] {
    each_constraint(s.bends, m.bends, backward, [&](int c, std::array<double, 2>& lambda) {
      const auto& vertices = s.bends.vertices[c];
      const auto& n = s.bends.numbers[c];
      const Constraint angle = [&](const Corners& at) {
        const Vec3 e = (at[3] - at[2]).normalized();
        const Vec3 n0 = (at[0] - at[2]).cross(at[0] - at[3]);
        const Vec3 n1 = (at[1] - at[3]).cross(at[1] - at[2]);
        const double is = std::atan2(n1.cross(n0).dot(e), n0.dot(n1));
        return std::remainder(is - n[0], 2 * M_PI);
      };
      const Corners at = corners_of(p, vertices);
      const std::vector<Vec3> g = gradient(angle, at, 1e-8);
      const double a =
          std::max(n[1] * inverse_h2, mobility_of(p, vertices, g) / pbd::Bending::kMostOfStep);
      constexpr double kMost = pbd::Bending::kMost;
      project(p, vertices, std::min(kMost, std::max(-kMost, angle(at))), g, a, 1, lambda[0]);
    });
  };
  if (backward) {
    bends();
    links();
    strains();
    elastics();
  } else {
    elastics();
    strains();
    links();
    bends();
  }
}

/// A step without contact, every other sweep backward: where vertices are afterwards.
inline PbdPlaces step(const pbd::State& s, double h) {
  PbdPlaces p = pbd_places(s);
  for (std::size_t i = 0; i < p.x.size(); ++i) {
    if (p.w[i] > 0) {
      p.x[i] += h * (std::exp(-s.scene.damping * h) * s.vertices.velocity(static_cast<int>(i)) +
                     h * s.scene.gravity);
    }
  }
  PbdMultipliers multipliers;
  const int sweeps = pbd::sweeps_of_step(s);
  for (int i = 0; i < sweeps; ++i) {
    project_constraints(s, h, p, multipliers, sweeps == 1, i % 2 == 1);
  }
  return p;
}

}  // namespace reference
}  // namespace tissue_sim
