#include "mls/own_rate.h"

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

namespace tissue_sim {
namespace {

/// In units of c^2 / h^2; see strained_volume().
constexpr double kMostOfWhole = 20, kMostBesideCut = 4.5;

/// own_rate() of a node whose support spans space, over (lambda + 2 mu) times its volume
/// [1 / (kg m^2)]. Its strain is sum_j (u_j - u_i) (x) w_ij M_i^-1 r_ij: that is
/// tr(M^-1 B M^-1) + |M^-1 b|^2 / m_i with B = sum_j w^2 / m_j r r^T and b = sum_j w r.
double rate_of_strain(const MlsState& s, std::int32_t i, const MlsSums& sums) {
  Eigen::Matrix3d inverse;
  const auto m = [&](int k) { return static_cast<double>(s.inverse_moment[k][i]); };
  inverse << m(0), m(3), m(4), m(3), m(1), m(5), m(4), m(5), m(2);
  const double* B = sums.per_mass;
  Eigen::Matrix3d per_mass;
  per_mass << B[0], B[3], B[4], B[3], B[1], B[5], B[4], B[5], B[2];
  const Vec3 b(sums.first[0], sums.first[1], sums.first[2]);
  const Eigen::Matrix3d both = inverse * per_mass;
  return both.cwiseProduct(inverse).sum() + (inverse * b).squaredNorm() * s.inv_mass[i];
}

/// The volume of the node that swings by itself at `most` c^2 / h^2, (lambda + 2 mu) V rate [m^3].
double volume_of_rate(const MlsState& s, std::int32_t i, const MlsSums& sums, double most) {
  const double edge = s.edge[i], rate = rate_of_strain(s, i, sums);
  return rate > 0 ? most / (s.nodes.material_of(i).density * edge * edge * rate) : 1e30;
}

}  // namespace

double own_rate(const MlsState& s, std::int32_t i) {
  const MlsPairs& p = s.pairs;
  if (s.sprung[i] == 0) {
    const Material& m = s.nodes.material_of(i);
    return (lame_lambda(m) + 2 * lame_mu(m)) * s.nodes.strained_volume[i] *
           rate_of_strain(s, i, mls_sums(s, i));
  }
  double sum = 0;
  for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
    sum += s.spring[e] * (s.inv_mass[i] + s.inv_mass[p.other[e]]);
  }
  return sum;
}

MlsSums mls_sums(const MlsState& s, std::int32_t i) {
  double m[6] = {}, per_mass[6] = {}, first[3] = {};
  const float* xi = &s.place[4 * i];
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const std::int32_t j = s.pairs.other[e];
    const float* xj = &s.place[4 * j];
    const double w = s.pairs.weight[e], q = w * w * s.inv_mass[j];
    // In float, as passes do, and so times the weight: nodes of a lattice would all err alike, and
    // turn a body.
    const float r[3] = {xj[0] - xi[0], xj[1] - xi[1], xj[2] - xi[2]};
    double W[3];
    for (int a = 0; a < 3; ++a) W[a] = s.pairs.weight[e] * r[a];
    const double x = r[0], y = r[1], z = r[2];
    const double products[6] = {x * x, y * y, z * z, x * y, x * z, y * z};
    const double weighted[6] = {x * W[0],
                                y * W[1],
                                z * W[2],
                                0.5 * (x * W[1] + y * W[0]),
                                0.5 * (x * W[2] + z * W[0]),
                                0.5 * (y * W[2] + z * W[1])};
    for (int k = 0; k < 6; ++k) {
      m[k] += weighted[k];
      per_mass[k] += q * products[k];
    }
    first[0] += w * x;
    first[1] += w * y;
    first[2] += w * z;
  }
  MlsSums sums;
  std::copy_n(m, 6, sums.moment);
  std::copy_n(per_mass, 6, sums.per_mass);
  std::copy_n(first, 3, sums.first);
  return sums;
}

float strained_volume(const MlsState& s, std::int32_t i) {
  return strained_volume(s, i, mls_sums(s, i));
}

float strained_volume(const MlsState& s, std::int32_t i, const MlsSums& sums) {
  const float whole = s.nodes.strained_volume[i];
  if (s.cut[i] == 0 || s.sprung[i] != 0) return whole;
  return static_cast<float>(std::min<double>(whole, volume_of_rate(s, i, sums, kMostBesideCut)));
}

bool bound_own_rates(MlsState& s) {
  bool any = false;
  std::vector<float> bounded(s.count());
  s.cpu->for_each(
      s.count(),
      [&](int i) {
        const double most =
            s.sprung[i] == 0 ? volume_of_rate(s, i, mls_sums(s, i), kMostOfWhole) : 1e30;
        bounded[i] = static_cast<float>(std::min<double>(s.nodes.strained_volume[i], most));
      },
      256);
  for (std::int32_t i = 0; i < s.count(); ++i) {
    any = any || bounded[i] < s.nodes.strained_volume[i];
    s.nodes.strained_volume[i] = bounded[i];
  }
  return any;
}

}  // namespace tissue_sim
