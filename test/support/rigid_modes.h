// How many motions of a body cost no energy.
#pragma once

#include <Eigen/SparseCholesky>
#include <utility>
#include <vector>

#include "mpm/mpm_state.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {

/// Number of eigenvalues below `bound`: as many as pivots of the shifted matrix are negative
/// (Sylvester's law of inertia).
inline int eigenvalues_below(const Eigen::SparseMatrix<double>& matrix, double bound) {
  Eigen::SparseMatrix<double> unit(matrix.rows(), matrix.cols());
  unit.setIdentity();
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix - bound * unit);
  return static_cast<int>((solver.vectorD().array() < 0).count());
}

/// Motions of the points that cost no energy: null space of strains and stabilisation, less what
/// moves nodes alone and no point.
inline int rigid_modes(const MpmState& s) {
  const int n = 3 * static_cast<int>(s.nodes.size());
  using Row = std::vector<std::pair<int, double>>;
  struct Rows {
    std::vector<Eigen::Triplet<double>> entries;
    int count = 0;

    void add(const Row& row) {
      for (const auto& [i, a] : row) entries.emplace_back(count, i, a);
      ++count;
    }
    Eigen::SparseMatrix<double> squared(int n) const {
      Eigen::SparseMatrix<double> rows(count, n);
      rows.setFromTriplets(entries.begin(), entries.end());
      return rows.transpose() * rows;
    }
  } energy, motion;
  for (int p = 0; p < s.points.size(); ++p) {
    const reference::Stencil stencil = reference::stencil_of(s, p);
    Row strain[6], place[3];
    for (int k = 0; k < 27; ++k) {
      const int i = 3 * stencil.node[k];
      const Vec3 g = stencil.slope[k] * s.bodies[0].cell_size;
      for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3;
        strain[a].emplace_back(i + a, g[a]);
        strain[3 + a].emplace_back(i + a, g[b]);
        strain[3 + a].emplace_back(i + b, g[a]);
        place[a].emplace_back(i + a, stencil.weight[k]);
      }
    }
    for (const Row& row : strain) energy.add(row);
    for (const Row& row : place) motion.add(row);
  }
  const std::vector<double> volume = reference::elastic_volumes(s);
  for (const Block* block : s.blocks.all) {
    for (const Row& row : reference::stabilising_rows(s, volume, *block)) {
      for (int a = 0; a < 3; ++a) {
        Row of_component = row;
        for (auto& [i, value] : of_component) i = 3 * i + a;
        energy.add(of_component);
      }
    }
  }
  const Eigen::SparseMatrix<double> stiffness = energy.squared(n);
  const double bound = 1e-11 * Eigen::VectorXd(stiffness.diagonal()).maxCoeff();
  const Eigen::SparseMatrix<double> seen = stiffness + motion.squared(n);
  return eigenvalues_below(stiffness, bound) - eigenvalues_below(seen, bound);
}

}  // namespace tissue_sim
