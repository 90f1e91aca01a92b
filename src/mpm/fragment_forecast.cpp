#include "mpm/fragment_forecast.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "mpm/fragment_features.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// SplitMix64.
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

void expect_deformation(const NetworkWeights& modifier, const float* x, FragmentChance& chance) {
  float out[kModifierOutputs];
  run_network(modifier, x, out);
  for (int i = 0; i < 9; ++i) {
    chance.F[i] = x[i] + out[i];
    chance.deviation[i] = std::exp(0.5f * out[9 + i]);
  }
}

/// The proper one with singular values from 1 / most to most whose axes are the same.
Eigen::Matrix3d within(const Eigen::Matrix3d& F, double most) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  // GCC 12 takes singularValues() for uninitialised here.
  const Vec3 stretches = (U.transpose() * F * svd.matrixV()).diagonal();
  const Vec3 s = stretches.cwiseMin(most).cwiseMax(1 / most);
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * s.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace

double standard_normal(std::uint64_t seed, std::uint64_t counter) {
  const std::uint64_t a = mixed(mixed(seed) ^ (2 * counter)),
                      b = mixed(mixed(seed) ^ (2 * counter + 1));
  const double u = (static_cast<double>(a >> 11) + 0.5) * 0x1p-53,
               v = static_cast<double>(b >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(6.283185307179586 * v);
}

std::vector<FragmentChance> forecast_fragments(MpmState& state, const Pieces& pieces,
                                               const FragmentNetwork& network,
                                               const FragmentClassifier& classifier) {
  const std::vector<std::int32_t> points = fragment_candidates(state, pieces, kForecastShare);
  std::vector<FragmentChance> chances(points.size());
  const NetworkWeights own = network.classifier(), modifier = network.modifier();
  state.cpu->for_each(
      static_cast<int>(points.size()),
      [&](int i) {
        float x[kFeatureCount];
        fragment_features(state, points[i], x);
        FragmentChance& c = chances[i];
        c.point = points[i];
        c.probability = classifier ? classifier(state, points[i], x) : fragment_probability(own, x);
        c.time = state.time;
        if (c.is_expected()) expect_deformation(modifier, x, c);
      },
      32);
  return chances;
}

void remember(const std::vector<FragmentChance>& now, double since,
              std::vector<FragmentChance>& before) {
  std::vector<FragmentChance> all;
  all.reserve(now.size() + before.size());
  auto old = before.cbegin();
  const auto keep = [&] {
    if (old->time >= since) all.push_back(*old);
    ++old;
  };
  for (const FragmentChance& c : now) {
    while (old != before.cend() && old->point < c.point) keep();
    if (old != before.cend() && old->point == c.point) ++old;
    all.push_back(c);
  }
  while (old != before.cend()) keep();
  before = std::move(all);
}

bool draw_deformation(const MpmState& state, const Pieces& pieces, int piece,
                      const std::vector<FragmentChance>& said, Eigen::Matrix3d& F) {
  double of_body = 0;
  const Fragment* own = nullptr;
  for (const Fragment& f : pieces.all) {
    if (f.id == piece) own = &f;
  }
  if (own == nullptr || !own->loose) return false;
  for (const Fragment& f : pieces.all) of_body += f.body == own->body ? f.volume : 0;
  const LatticeBody& body = state.bodies[own->body];
  const double cell = body.cell_size * body.cell_size * body.cell_size;
  if (own->volume < 0.5 * cell || own->volume > 0.4 * of_body) return false;
  int looked_at = 0, expected = 0;
  double probability = 0;
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero(), deviation = mean;
  for (const FragmentChance& c : said) {
    if (pieces.of_point[c.point] != piece) continue;
    ++looked_at;
    probability += c.probability;
    if (!c.is_expected()) continue;
    ++expected;
    for (int i = 0; i < 9; ++i) {
      mean(i / 3, i % 3) += c.F[i];
      deviation(i / 3, i % 3) += c.deviation[i];
    }
  }
  if (expected == 0 || probability < 0.5 * looked_at) return false;
  for (int i = 0; i < 9; ++i) {
    const auto counter = static_cast<std::uint64_t>(piece) * 9 + i;
    F(i / 3, i % 3) = (mean(i / 3, i % 3) +
                       deviation(i / 3, i % 3) * standard_normal(state.scene.seed, counter)) /
                      expected;
  }
  const float limit = least_tear_limit(body);
  if (!F.allFinite()) return false;
  F = within(F, limit > 0 ? 1 + kForecastShare * (limit - 1) : 2);
  return true;
}

}  // namespace tissue_sim
