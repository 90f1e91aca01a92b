// Stiffness and mass of meshless nodes for small displacements.
#pragma once

#include <Eigen/SparseCholesky>
#include <memory>
#include <utility>
#include <vector>

#include "mls/tissue.h"

namespace tissue_sim {

/// Small motions of nodes that nothing holds.
struct SmallMotion {
  std::unique_ptr<MlsTissue> tissue;
  std::vector<int> number;  ///< of each node among those that are free; -1: held
  Eigen::SparseMatrix<double> stiffness;
  Eigen::VectorXd mass;
};

/// Small displacements, in double, from the program's own weights and moments.
inline SmallMotion small_motion(const Scene& scene) {
  SmallMotion motion;
  motion.tissue = std::make_unique<MlsTissue>(scene);
  const MlsState& s = motion.tissue->state();
  std::vector<int> number(s.count(), -1);
  int free = 0;
  for (int i = 0; i < s.count(); ++i) {
    if (s.inv_mass[i] > 0) number[i] = free++;
  }
  std::vector<Eigen::Triplet<double>> entries;
  motion.mass = Eigen::VectorXd::Zero(3 * free);
  for (int i = 0; i < s.count(); ++i) {
    const int first = s.pairs.begin[i], m = s.pairs.begin[i + 1] - first;
    Eigen::Matrix3d inverse;
    const auto M = [&](int k) { return static_cast<double>(s.inverse_moment[k][i]); };
    inverse << M(0), M(3), M(4), M(3), M(1), M(5), M(4), M(5), M(2);
    // H = sum_a u_a (x) g_a over the neighbours, the node itself last.
    Eigen::MatrixXd g = Eigen::MatrixXd::Zero(3, m + 1), r(3, m);
    Eigen::VectorXd weight(m);
    std::vector<int> of(m + 1, number[i]);
    for (int k = 0; k < m; ++k) {
      const int j = s.pairs.other[first + k];
      of[k] = number[j];
      weight[k] = s.pairs.weight[first + k];
      r.col(k) = s.nodes.place[j] - s.nodes.place[i];
      g.col(k) = weight[k] * inverse * r.col(k);
      g.col(m) -= g.col(k);
    }
    Eigen::MatrixXd left = -r.transpose() * g;  // of each pair
    for (int k = 0; k < m; ++k) {
      left(k, k) += 1;
      left(k, m) -= 1;
    }
    const Eigen::MatrixXd penalty =
        static_cast<double>(s.kappa[i]) * left.transpose() * weight.asDiagonal() * left;
    const double mu = s.volume_mu[i], lambda = s.volume_lambda[i];
    for (int a = 0; a <= m; ++a) {
      for (int b = 0; b <= m; ++b) {
        if (of[a] < 0 || of[b] < 0) continue;
        const Vec3 ga = g.col(a), gb = g.col(b);
        Eigen::Matrix3d local = mu * gb * ga.transpose() + lambda * ga * gb.transpose();
        local.diagonal().array() += mu * ga.dot(gb) + penalty(a, b);
        for (int c = 0; c < 9; ++c) {
          entries.emplace_back(3 * of[a] + c / 3, 3 * of[b] + c % 3, local(c / 3, c % 3));
        }
      }
    }
    if (number[i] >= 0) motion.mass.segment<3>(3 * number[i]).setConstant(s.mass[i]);
  }
  motion.stiffness.resize(3 * free, 3 * free);
  motion.stiffness.setFromTriplets(entries.begin(), entries.end());
  motion.number = std::move(number);
  return motion;
}

}  // namespace tissue_sim
