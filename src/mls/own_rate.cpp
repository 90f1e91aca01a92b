#include "mls/own_rate.h"

#include <algorithm>
#include <vector>

namespace tissue_sim {
namespace {

/// In units of c^2 / h^2; see strained_volume().
constexpr double kMostOfWhole = 6.5, kMostBesideCut = 4.5;

/// own_rate() of a node whose support spans space, over (lambda + 2 mu) times its volume
/// [1 / (kg m^2)]. Its strain is sum_j (u_j - u_i) (x) g_j with g_j = w_ij M_i^-1 r_ij.
double rate_of_strain(const MlsState& s, std::int32_t i) {
  const MlsPairs& p = s.pairs;
  double m[6], sum = 0, all[3] = {};
  for (int k = 0; k < 6; ++k) m[k] = s.inverse_moment[k][i];
  for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
    const std::int32_t j = p.other[e];
    double r[3], g[3];
    for (int a = 0; a < 3; ++a) r[a] = s.place[4 * j + a] - s.place[4 * i + a];
    g[0] = p.weight[e] * (m[0] * r[0] + m[3] * r[1] + m[4] * r[2]);
    g[1] = p.weight[e] * (m[3] * r[0] + m[1] * r[1] + m[5] * r[2]);
    g[2] = p.weight[e] * (m[4] * r[0] + m[5] * r[1] + m[2] * r[2]);
    for (int a = 0; a < 3; ++a) {
      sum += g[a] * g[a] * s.inv_mass[j];
      all[a] += g[a];
    }
  }
  for (const double g : all) sum += g * g * s.inv_mass[i];
  return sum;
}

/// The volume of the node that swings by itself at `most` c^2 / h^2, (lambda + 2 mu) V rate [m^3].
double volume_of_rate(const MlsState& s, std::int32_t i, double most) {
  const double edge = s.edge[i], rate = rate_of_strain(s, i);
  return rate > 0 ? most / (s.nodes.material_of(i).density * edge * edge * rate) : 1e30;
}

}  // namespace

double own_rate(const MlsState& s, std::int32_t i) {
  const MlsPairs& p = s.pairs;
  if (s.sprung[i] == 0) {
    return (s.volume_lambda[i] + 2 * s.volume_mu[i]) * rate_of_strain(s, i);
  }
  double sum = 0;
  for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
    sum += s.spring[e] * (s.inv_mass[i] + s.inv_mass[p.other[e]]);
  }
  return sum;
}

float strained_volume(const MlsState& s, std::int32_t i) {
  const float whole = s.nodes.strained_volume[i];
  if (s.cut[i] == 0 || s.sprung[i] != 0) return whole;
  return static_cast<float>(std::min<double>(whole, volume_of_rate(s, i, kMostBesideCut)));
}

bool bound_own_rates(MlsState& s) {
  bool any = false;
  std::vector<float> bounded(s.count());
  s.cpu->for_each(
      s.count(),
      [&](int i) {
        const double most = s.sprung[i] == 0 ? volume_of_rate(s, i, kMostOfWhole) : 1e30;
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
