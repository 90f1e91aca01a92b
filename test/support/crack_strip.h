// A strip with an edge crack under tension: how much more it gives for the crack.
#pragma once

#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"

namespace tissue_sim {

/// A strip one cell thick, pulled along x by uniform traction on its ends, cut from the edge y = 0
/// across half its width. Poisson's ratio is 0: plane stress and plane strain are the same, nothing
/// varies along z, and what is left is a problem in two dimensions, small enough for a direct
/// solution in double precision.
struct CrackStrip {
  double width = 0.04, length = 0.16;  ///< along y and x [m]
  double young_modulus = 1e4;          ///< [Pa]
  double cell_size;                    ///< [m]
  double crack_x;                      ///< where the crack is, along the strip [m]

  /// `deep`: cells along the crack. `at_nodes`: the crack runs through nodes, else between them.
  explicit CrackStrip(int deep, bool at_nodes = false)
      : cell_size(0.02 / deep), crack_x(0.08 + (at_nodes ? 0.5 * cell_size : 0)) {}

  std::unique_ptr<MpmTissue> tissue(bool cracked, double depth = 0.02) const {
    Scene scene = free_box(Vec3(length, width, cell_size), cell_size);
    Material material;
    material.name = "strip";
    material.young_modulus = young_modulus;
    material.poisson_ratio = 0;
    scene.materials = {material};
    scene.bodies[0].material = "strip";
    auto result = std::make_unique<MpmTissue>(scene);
    if (cracked) {
      cut_now(*result, upright_blade({Vec3(crack_x, -0.01, 0), Vec3(crack_x, depth, 0)}));
    }
    return result;
  }
};

/// The strip at rest under a pull, in the limit of small displacements.
struct PulledStrip {
  std::vector<Vec3> u, load;  ///< per node [m], [N]
  std::vector<Vec3> d;        ///< per node that is parted ahead of the crack [m]
  double compliance;          ///< displacement of the ends over the pull [m/N]
};

/// Adds the stiffness of the cells at the crack's front; nodes that are parted ahead of it get
/// further unknowns, which it returns by those of the nodes.
inline std::map<int, int> add_front(const MpmState& s, const std::vector<int>& unknown, int& count,
                                    std::vector<Eigen::Triplet<double>>& entries) {
  const double h = s.bodies[0].cell_size;
  const double kinds[3][3] = {{0.15625, 0.6875, 0.15625}, {-0.5, 0, 0.5}, {0.25, -0.5, 0.25}};
  std::map<int, int> apart;  // by the unknown of their node
  for (const FrontNode& n : s.front.nodes) {
    if (apart.emplace(unknown[n.node], count).second) ++count;
  }
  using Row = std::map<int, double>;  // of unknowns
  const auto add = [&entries](double stiffness, const Row& row) {
    for (const auto& [i, a] : row) {
      for (const auto& [j, b] : row) entries.emplace_back(i, j, stiffness * a * b);
    }
  };
  for (const FrontCell& cell : s.front.cells) {
    const FrontPart* parts = s.front.parts.data() + cell.first;
    for (int p = 0; p < 8; ++p) {
      if (cell.mu[p] == 0) continue;
      Row strain[3];
      const auto add_node = [&](int k, int column, double side) {
        double w[3], slope[3];
        for (int a = 0; a < 3; ++a) {
          const int d = a == 0 ? k % 3 : a == 1 ? k / 3 % 3 : k / 9;
          const double r = ((p >> a & 1) - 0.5) / 2 + 1 - d;
          w[a] = reference::spline(r);
          slope[a] = reference::spline_slope(r);
        }
        const double x = side * slope[0] * w[1] * w[2] / h, y = side * w[0] * slope[1] * w[2] / h;
        strain[0][2 * column] += x;
        strain[1][2 * column + 1] += y;
        strain[2][2 * column] += y / std::sqrt(2);
        strain[2][2 * column + 1] += x / std::sqrt(2);
      };
      for (int k = 0; k < 27; ++k) add_node(k, unknown[cell.node[k]], 1);
      for (const Row& row : strain) add(-2 * cell.mu[p] * parts[0].share, row);
      for (int j = 0; j < cell.count; ++j) {
        const int node = s.front.nodes[parts[j].node].node;
        add_node(parts[j].k, apart[unknown[node]], parts[j].side);
        for (const Row& row : strain) add(2 * cell.mu[p] * parts[j].step, row);
      }
    }
    for (int f = 0; f < 27 && cell.stabilised > 0; ++f) {
      if (f % 3 + f / 3 % 3 + f / 9 <= 1) continue;
      Row row[2];
      for (int j = 0; j < cell.count; ++j) {
        const int k = parts[j].k, node = s.front.nodes[parts[j].node].node;
        const double a = kinds[f % 3][k % 3] * kinds[f / 3 % 3][k / 3 % 3] * kinds[f / 9][k / 9] *
                         parts[j].side * std::sqrt(parts[j].share) / h;
        for (int c = 0; c < 2; ++c) row[c][2 * apart[unknown[node]] + c] += a;
      }
      for (const Row& of : row) add(cell.stabilised, of);
    }
  }
  return apart;
}

/// Nodes of all layers along z move alike: each is mapped to one unknown.
inline PulledStrip pull(const MpmState& s, double traction) {
  const LatticeBody& b = s.bodies[0];
  const double mu = lame_mu(b.materials[0]), h = b.cell_size;
  std::vector<int> unknown(s.nodes.size(), -1);
  int count = 0;
  using Local = Eigen::Matrix<double, 18, 18>;
  std::map<std::array<int, 9>, Local> cells;  // stiffness by the unknowns that points see
  Eigen::VectorXd load = Eigen::VectorXd::Zero(2 * static_cast<int>(s.nodes.size()));
  for (int p = 0; p < s.points.size(); ++p) {
    const reference::Stencil stencil = reference::stencil_of(s, p);
    std::array<int, 9> nodes;
    Eigen::Matrix<double, 3, 18> strain = Eigen::Matrix<double, 3, 18>::Zero();
    const Points::Site& site = s.points.site[p];
    const double pull = site.x == 0 ? -1 : site.x == 2 * b.nx - 1 ? 1 : 0;
    for (int k = 0; k < 27; ++k) {
      int& column = unknown[stencil.node[9 + k % 9]];
      if (column < 0) column = count++;
      unknown[stencil.node[k]] = column;
      nodes[k % 9] = column;
      const int i = 2 * (k % 9);
      strain(0, i) += stencil.slope[k].x();
      strain(1, i + 1) += stencil.slope[k].y();
      strain(2, i) += stencil.slope[k].y() / std::sqrt(2);
      strain(2, i + 1) += stencil.slope[k].x() / std::sqrt(2);
      load[2 * column] += pull * traction * h * h / 4 * stencil.weight[k];
    }
    Local& local = cells.try_emplace(nodes, Local::Zero()).first->second;
    local += 2 * mu * s.points.volume[p] * strain.transpose() * strain;
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (const auto& [nodes, local] : cells) {
    for (int i = 0; i < 18; ++i) {
      for (int j = 0; j < 18; ++j) {
        entries.emplace_back(2 * nodes[i / 2] + i % 2, 2 * nodes[j / 2] + j % 2, local(i, j));
      }
    }
  }
  const std::vector<double> volume = reference::elastic_volumes(s);
  for (const Block* block : s.blocks.all) {
    for (const auto& row : reference::stabilising_rows(s, volume, *block)) {
      std::map<int, double> merged;
      for (const auto& [node, a] : row) merged[unknown[node]] += a;
      for (const auto& [i, a] : merged) {
        for (const auto& [j, c] : merged) {
          for (int k = 0; k < 2; ++k) entries.emplace_back(2 * i + k, 2 * j + k, a * c);
        }
      }
    }
  }
  std::map<int, int> apart = add_front(s, unknown, count, entries);
  // A breath of stiffness against rigid motion, which no load excites.
  for (int i = 0; i < 2 * count; ++i) entries.emplace_back(i, i, 1e-9 * mu * h);
  Eigen::SparseMatrix<double> stiffness(2 * count, 2 * count);
  stiffness.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(stiffness);
  load.conservativeResizeLike(
      Eigen::VectorXd::Zero(2 * static_cast<int>(s.nodes.size()) + 2 * count));
  const Eigen::VectorXd f = load.head(2 * count);
  const Eigen::VectorXd x = solver.solve(f);
  const double force = traction * 2 * b.ny * h / 2 * h;
  PulledStrip result;
  result.compliance = f.dot(x) / (force * force);
  result.u.assign(s.nodes.size(), Vec3::Zero());
  result.load = result.u;
  for (std::size_t i = 0; i < s.nodes.size(); ++i) {
    if (unknown[i] >= 0) result.u[i] = Vec3(x[2 * unknown[i]], x[2 * unknown[i] + 1], 0);
  }
  for (const FrontNode& n : s.front.nodes) {
    const int column = apart[unknown[n.node]];
    result.d.emplace_back(x[2 * column], x[2 * column + 1], 0);
  }
  for (int p = 0; p < s.points.size(); ++p) {
    const Points::Site& site = s.points.site[p];
    const double pull = site.x == 0 ? -1 : site.x == 2 * b.nx - 1 ? 1 : 0;
    if (pull == 0) continue;
    const reference::Stencil stencil = reference::stencil_of(s, p);
    for (int k = 0; k < 27; ++k) {
      result.load[stencil.node[k]].x() += pull * traction * h * h / 4 * stencil.weight[k];
    }
  }
  return result;
}

/// Fracture mechanics: the compliance that an edge crack of length a adds to a strip of width W
/// under uniform tension, 2 pi / (E t) int_0^(a/W) x F(x)^2 dx (Irwin's energy release rate), with
/// F of Tada, Paris, Irwin 2000, p. 2.11, within 0.5 %.
inline double crack_compliance(double young_modulus, double thickness, double share) {
  const auto integrand = [](double x) {
    if (x == 0) return 0.0;
    const double angle = M_PI * x / 2, s = 1 - std::sin(angle);
    const double F = std::sqrt(std::tan(angle) / angle) * (0.752 + 2.02 * x + 0.37 * s * s * s) /
                     std::cos(angle);
    return x * F * F;
  };
  constexpr int kSteps = 200;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {  // Simpson's rule
    const double a = share * i / kSteps, b = share * (i + 1) / kSteps;
    sum += (b - a) / 6 * (integrand(a) + 4 * integrand((a + b) / 2) + integrand(b));
  }
  return 2 * M_PI / (young_modulus * thickness) * sum;
}

/// The crack length, as a share of the width, whose compliance this is.
inline double effective_share(double young_modulus, double thickness, double compliance) {
  double lo = 0, hi = 0.9;
  for (int i = 0; i < 60; ++i) {
    const double mid = (lo + hi) / 2;
    (crack_compliance(young_modulus, thickness, mid) < compliance ? lo : hi) = mid;
  }
  return lo;
}

}  // namespace tissue_sim
