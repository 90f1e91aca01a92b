#include "mls/substep_choice.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mls/linearised_motion.h"

namespace tissue_sim {
namespace {

constexpr int kLanczosSteps = 8;        // of Lanczos' method
constexpr double kMargin = 0.76;        // of the limit: the rest is for contact and what stiffens
constexpr double kLongestAge = 0.5;     // of the measured limit [s]
constexpr double kLongestAgeCut = 0.1;  // the same while something is cut [s]
constexpr double kMostRate = 1.2;       // growth of the fastest node's rate by a cut, until then
constexpr double kMostGrowth = 1.3;     // of the stiffness, until the limit is measured again
constexpr double kBorne = 0.9;          // of the limit at the end of a part: else it is undone ...
constexpr double kShorter = 0.6;        // ... and substeps made shorter by that
constexpr double kShortest = 1e-3;      // until by that: then it is no use
constexpr double kMostAbove = 1.1;      // the first substep over what all should come to
constexpr int kFewest = 6, kMost = 64;  // substeps of a part

/// P-wave modulus of a node whose cofactor's columns grew to `stiffening`, squared [Pa].
double modulus(const Material& m, double stiffening) {
  const double mu = lame_mu(m), lambda = lame_lambda(m);
  const double volumetric = m.law == Law::kNeoHookean ? lambda + mu : lambda;
  return lambda + 2 * mu + volumetric * std::max(0.0, stiffening - 1);
}

/// Shortens an elastic limit for viscosity, whose fastest rate is that of the mode of the highest
/// frequency: c = 2 eta / (lambda + 2 mu) omega^2, growing with the square of the stretch.
double with_viscosity(const MlsState& s, double limit, double stiffening) {
  double shortest = limit;
  const double omega = 2 / limit;
  for (const Material& m : s.nodes.materials) {
    if (m.viscosity == 0) continue;
    const double rate =
        2 * m.viscosity / (lame_lambda(m) + 2 * lame_mu(m)) * omega * omega * stiffening;
    const double b = 0.25 * rate * limit * limit;
    shortest = std::min(shortest, std::sqrt(b * b + limit * limit) - b);
  }
  return shortest;
}

}  // namespace

double MlsSubsteps::growth(const MlsState& s, const std::vector<float>& stiffening) const {
  double most = 1;
  for (int i = 0; i < s.count(); ++i) {
    const Material& m = s.nodes.material_of(i);
    const double g = modulus(m, stiffening[i]) / modulus(m, measured_.empty() ? 1 : measured_[i]);
    if (!(g <= most)) most = g;
  }
  return most;
}

bool MlsSubsteps::is_due(const MlsState& s) const {
  return limit_ == 0 || s.time - measured_at_ > (was_cut_ ? kLongestAgeCut : kLongestAge) ||
         (growth_ > kMostGrowth && s.time > measured_at_);
}

void MlsSubsteps::measure(const MlsState& s, const MlsForces& forces) {
  is_new_ = limit_ == 0;
  limit_ = measured_limit(s, forces, kLanczosSteps);
  if (!std::isfinite(limit_)) limit_ = 1;  // all is held
  measured_ = now_;
  measured_at_ = s.time;
  growth_ = 1;
  was_cut_ = false;
  std::vector<double> of_group(s.groups(), 0.0);
  s.cpu->for_each(s.groups(), [&](int group) {
    const int first = group * kMlsGroup, last = std::min(s.count(), first + kMlsGroup);
    for (int i = first; i < last; ++i) of_group[group] = std::max(of_group[group], own_rate(s, i));
  });
  most_rate_ = of_group.empty() ? 0 : *std::max_element(of_group.begin(), of_group.end());
}

void MlsSubsteps::cut(const MlsState& s, const std::vector<std::int32_t>& nodes) {
  was_cut_ = true;
  if (limit_ == 0) return;  // it is measured anyway
  for (const std::int32_t i : nodes) {
    if (own_rate(s, i) > kMostRate * most_rate_) limit_ = 0;
  }
}

double own_rate(const MlsState& s, std::int32_t i) {
  const MlsPairs& p = s.pairs;
  double sum = 0;
  if (s.sprung[i] != 0) {
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      sum += s.spring[e] * (s.inv_mass[i] + s.inv_mass[p.other[e]]);
    }
    return sum;
  }
  // Its strain is sum_j (u_j - u_i) (x) g_j with g_j = w_ij M_i^-1 r_ij.
  double all[3] = {};
  for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
    const std::int32_t j = p.other[e];
    double r[3], g[3];
    for (int a = 0; a < 3; ++a) r[a] = s.place[4 * j + a] - s.place[4 * i + a];
    const auto m = [&](int k) { return static_cast<double>(s.inverse_moment[k][i]); };
    g[0] = p.weight[e] * (m(0) * r[0] + m(3) * r[1] + m(4) * r[2]);
    g[1] = p.weight[e] * (m(3) * r[0] + m(1) * r[1] + m(5) * r[2]);
    g[2] = p.weight[e] * (m(4) * r[0] + m(5) * r[1] + m(2) * r[2]);
    for (int a = 0; a < 3; ++a) {
      sum += g[a] * g[a] * s.inv_mass[j];
      all[a] += g[a];
    }
  }
  for (const double g : all) sum += g * g * s.inv_mass[i];
  return (s.volume_lambda[i] + 2 * s.volume_mu[i]) * sum;
}

PartSubsteps MlsSubsteps::part(const MlsState& s, double time) {
  const bool is_new = std::exchange(is_new_, false);
  double stretch = 1;
  for (const float x : now_) stretch = std::max<double>(stretch, x);
  const double elastic = limit_ / std::sqrt(growth_ * trend_);
  const double asked = std::min(1.0, s.scene.cfl / Scene().cfl);
  const double longest = shortened_ * asked * kMargin * with_viscosity(s, elastic, stretch);
  const bool at_once = is_new || shortened_ < 1;
  PartSubsteps part = substeps_for(time, longest, s.dt, at_once ? 0 : kMostAbove * longest);
  const int most = shortened_ < 1 ? kFewest : count_;
  const int parts = (part.count + most - 1) / most;
  part.count = (part.count + parts - 1) / parts;
  return part;
}

bool MlsSubsteps::is_borne(const MlsState& s, const std::vector<float>& stiffening, double dt) {
  const double now = growth(s, stiffening);
  const double longest = std::isfinite(now) ? limit_ / std::sqrt(now) : 0;
  if (dt > kBorne * longest && shortened_ > kShortest) {
    shortened_ *= kShorter;
    return false;
  }
  trend_ = std::min(4.0, std::max(1.0, now / growth_));
  growth_ = now;
  now_ = stiffening;
  shortened_ = 1;
  count_ = trend_ > 1.3   ? std::max(kFewest, count_ / 2)
           : trend_ < 1.2 ? std::min(kMost, 2 * count_)
                          : count_;
  return true;
}

}  // namespace tissue_sim
