// Small bodies of nodes, and a reference of one substep in double.
#pragma once

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "material/laws.h"
#include "mls/own_rate.h"
#include "mls/tissue.h"
#include "support/cut_paths.h"

namespace tissue_sim {

/// A box of nodes alone in space: no ground, no gravity. Its lowest corner is the origin.
inline Scene mls_box(const Vec3& size, double spacing,
                     MlsPlacement placement = MlsPlacement::kRegular) {
  Scene scene;
  scene.method = Method::kMls;
  scene.device = Device::kCpu;
  scene.cell_size = 2 * spacing;
  scene.mls.placement = placement;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  Body body;
  body.size = size;
  body.pose.position = 0.5 * size;
  scene.bodies.push_back(body);
  return scene;
}

/// u = A X for all nodes.
inline void impose(MlsState& s, const Eigen::Matrix3d& A) {
  for (int i = 0; i < s.count(); ++i) {
    const Vec3 u = A * Vec3(s.place[4 * i], s.place[4 * i + 1], s.place[4 * i + 2]);
    for (int a = 0; a < 3; ++a) s.u[4 * i + a] = static_cast<float>(u[a]);
  }
}

namespace reference {

/// How much stiffer springs of a support with these moments are than a bar's: 1 of one direction, 3
/// of a plane.
inline double spring_share(const Eigen::Matrix3d& moments) {
  return 2 * moments.trace() * moments.trace() / moments.squaredNorm() - 1;
}

/// H_i of docs/mls.md, in double, from the weights as they are.
inline std::vector<Eigen::Matrix3d> mls_gradients(const MlsState& s) {
  std::vector<Eigen::Matrix3d> H(s.count(), Eigen::Matrix3d::Zero());
  for (int i = 0; i < s.count(); ++i) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero(), N = M;
    for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      const int j = s.pairs.other[e];
      Vec3 r, d;
      for (int a = 0; a < 3; ++a) {
        r[a] = static_cast<double>(s.place[4 * j + a]) - s.place[4 * i + a];
        d[a] = static_cast<double>(s.u[4 * j + a]) - s.u[4 * i + a];
      }
      M += s.pairs.weight[e] * r * r.transpose();
      N += s.pairs.weight[e] * d * r.transpose();
    }
    if (s.sprung[i] == 0) H[i] = N * M.inverse();
  }
  return H;
}

/// Elastic energy with the penalty at displacements `u` [4 n], by its definition.
inline double mls_energy(const MlsState& s, const std::vector<double>& u) {
  double sum = 0;
  for (int i = 0; i < s.count(); ++i) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero(), N = M;
    const auto pair = [&](int e, Vec3& r, Vec3& d) {
      const int j = s.pairs.other[e];
      for (int a = 0; a < 3; ++a) {
        r[a] = static_cast<double>(s.place[4 * j + a]) - s.place[4 * i + a];
        d[a] = u[4 * j + a] - u[4 * i + a];
      }
    };
    Vec3 r, d;
    double trace = 0, whole = 0;
    for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      pair(e, r, d);
      M += s.pairs.weight[e] * r * r.transpose();
      N += s.pairs.weight[e] * d * r.transpose();
      trace += s.pairs.weight[e] * r.squaredNorm();
      whole += s.pairs.whole[e] * r.squaredNorm();
    }
    const Material& m = s.nodes.material_of(i);
    const double volume = s.nodes.free_volume[i];
    if (s.sprung[i] != 0) {
      for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
        pair(e, r, d);
        const double stretch = (r + d).norm() - r.norm();
        sum += 0.5 * spring_share(M) * m.young_modulus * volume * s.pairs.weight[e] / trace *
               stretch * stretch;
      }
      continue;
    }
    const Eigen::Matrix3d H = N * M.inverse();
    double F[9];
    for (int k = 0; k < 9; ++k) F[k] = H(k / 3, k % 3) + (k % 4 == 0);
    const double mu = lame_mu(m), lambda = lame_lambda(m);
    sum += strained_volume(s, i) * (m.law == Law::kNeoHookean
                                        ? tissue_sim::energy<NeoHookean>(F, mu, lambda)
                                        : tissue_sim::energy<FixedCorotated>(F, mu, lambda));
    const double kappa = 3 * s.scene.mls.stabilisation * m.young_modulus * volume / whole;
    for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      pair(e, r, d);
      sum += 0.5 * kappa * s.pairs.weight[e] * (d - H * r).squaredNorm();
    }
  }
  return sum;
}

/// Forces on all nodes by the formula of the passes, in double.
inline std::vector<Vec3> mls_forces(const MlsState& s) {
  const std::vector<Eigen::Matrix3d> H = mls_gradients(s);
  std::vector<Eigen::Matrix3d> Q(s.count(), Eigen::Matrix3d::Zero());
  std::vector<double> kappa(s.count(), 0.0);
  const auto for_each_pair = [&](int i, const auto& f) {
    for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      const int j = s.pairs.other[e];
      Vec3 r, d;
      for (int a = 0; a < 3; ++a) {
        r[a] = static_cast<double>(s.place[4 * j + a]) - s.place[4 * i + a];
        d[a] = static_cast<double>(s.u[4 * j + a]) - s.u[4 * i + a];
      }
      f(e, j, static_cast<double>(s.pairs.weight[e]), r, d);
    }
  };
  for (int i = 0; i < s.count(); ++i) {
    if (s.sprung[i] != 0) continue;
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    double whole = 0;
    for_each_pair(i, [&](int e, int, double w, const Vec3& r, const Vec3&) {
      M += w * r * r.transpose();
      whole += s.pairs.whole[e] * r.squaredNorm();
    });
    const Material& m = s.nodes.material_of(i);
    const double volume = s.nodes.free_volume[i];
    double F[9], P[9];
    for (int k = 0; k < 9; ++k) F[k] = H[i](k / 3, k % 3) + (k % 4 == 0);
    if (m.law == Law::kNeoHookean) {
      stress<NeoHookean>(F, lame_mu(m), lame_lambda(m), P);
    } else {
      stress<FixedCorotated>(F, lame_mu(m), lame_lambda(m), P);
    }
    Eigen::Matrix3d stress_of;
    for (int k = 0; k < 9; ++k) stress_of(k / 3, k % 3) = P[k];
    kappa[i] = 3 * s.scene.mls.stabilisation * m.young_modulus * volume / whole;
    Q[i] = strained_volume(s, i) * stress_of * M.inverse() - kappa[i] * H[i];
  }
  // Springs of supports that span no space.
  const auto share = [&](int i, double w) {
    if (s.sprung[i] == 0) return 0.0;
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for_each_pair(i, [&](int, int, double weight, const Vec3& r, const Vec3&) {
      M += weight * r * r.transpose();
    });
    const double stiffness = s.nodes.material_of(i).young_modulus * s.nodes.volume[i];
    return w > 0 ? spring_share(M) * stiffness * w / M.trace() : 0.0;
  };
  std::vector<Vec3> force(s.count(), Vec3::Zero());
  for (int i = 0; i < s.count(); ++i) {
    for_each_pair(i, [&](int, int j, double w, const Vec3& r, const Vec3& d) {
      force[i] += w * ((Q[i] + Q[j]) * r + (kappa[i] + kappa[j]) * d);
      const double k = share(i, w) + share(j, w);
      const Vec3 x = r + d;
      force[i] += k * (x.norm() - r.norm()) * x.normalized();
    });
  }
  return force;
}

}  // namespace reference
}  // namespace tissue_sim
