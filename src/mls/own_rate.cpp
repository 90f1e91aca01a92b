#include "mls/own_rate.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstring>
#include <vector>

namespace tissue_sim {
namespace {

typedef double Two __attribute__((vector_size(16)));
constexpr int kAtATime = 32;  // entries

/// In units of c^2 / h^2; see strained_volume().
constexpr double kMostOfWhole = 20, kMostOfGiven = 8, kMostBesideCut = 4.5;

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
double volume_of_rate(const MlsState& s, std::int32_t i, const MlsSums& sums, double most,
                      double edge) {
  const double rate = rate_of_strain(s, i, sums);
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
  // Moments two side by side: 00 11, 22 01, 02 12. The others by coordinate; the fourth is void.
  Two m[3] = {};
  Vec<4> squares{}, products{}, first{};
  const MlsPairs& p = s.pairs;
  const std::int32_t *other = p.other.data(), end = p.begin[i + 1];
  const float *place = s.place.data(), *weight = p.weight.data(), *inv_mass = s.inv_mass.data();
  const Vec<4> xi = load<4>(place + 4 * i);
  for (std::int32_t e = p.begin[i]; e < end;) {
    // Beside a cut many pairs have no weight: the rest, listed without a branch.
    std::int32_t weighs[kAtATime];
    const std::int32_t until = std::min(end, e + kAtATime);
    int listed = 0;
    for (; e < until; ++e) {
      weighs[listed] = e;
      listed += weight[e] != 0 ? 1 : 0;
    }
    for (int k = 0; k < listed; ++k) {
      const std::int32_t j = other[weighs[k]];
      const float w = weight[weighs[k]];
      // In float, as passes do, and so times the weight: nodes of a lattice would all err alike,
      // and turn a body.
      const Vec<4> r = load<4>(place + 4 * j) - xi, W = w * r;
      const Two r01 = {r[0], r[1]}, W01 = {W[0], W[1]};
      const double z = r[2], Wz = W[2];
      const Two crosswise = r01 * Two{W01[1], W01[0]};
      m[0] += r01 * W01;
      m[1] += Two{z * Wz, 0.5 * (crosswise[0] + crosswise[1])};
      m[2] += 0.5 * (r01 * Wz + z * W01);
      const Vec<4> per_mass = w * inv_mass[j] * W;
      squares += per_mass * r;
      products += per_mass * permute<4>(r, Mask<4>{1, 2, 0, 3});
      first += W;
    }
  }
  MlsSums sums = {{},
                  {squares[0], squares[1], squares[2], products[0], products[2], products[1]},
                  {first[0], first[1], first[2]}};
  std::memcpy(sums.moment, m, sizeof(sums.moment));
  return sums;
}

float strained_volume(const MlsState& s, std::int32_t i) {
  return strained_volume(s, i, mls_sums(s, i));
}

float strained_volume(const MlsState& s, std::int32_t i, const MlsSums& sums) {
  const float whole = s.nodes.strained_volume[i];
  if (s.cut[i] == 0 || s.sprung[i] != 0) return whole;
  return static_cast<float>(
      std::min<double>(whole, volume_of_rate(s, i, sums, kMostBesideCut, s.edge[i])));
}

bool bound_own_rates(MlsState& s) {
  bool any = false;
  const std::vector<double> usual = usual_spacings(s.nodes);
  std::vector<float> bounded(s.count());
  s.cpu->for_each(
      s.count(),
      [&](int i) {
        const double edge = std::max<double>(s.edge[i], usual[s.nodes.body[i]]),
                     rate = s.nodes.part[i] < 0 ? kMostOfWhole : kMostOfGiven;
        const double most =
            s.sprung[i] == 0 ? volume_of_rate(s, i, mls_sums(s, i), rate, edge) : 1e30;
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
