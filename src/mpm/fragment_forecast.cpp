#include "mpm/fragment_forecast.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "geometry/mesh.h"
#include "math/draw.h"
#include "mpm/fragment_features.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

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
  const std::uint64_t a = split_mix(split_mix(seed) ^ (2 * counter)),
                      b = split_mix(split_mix(seed) ^ (2 * counter + 1));
  const double u = (static_cast<double>(a >> 11) + 0.5) * 0x1p-53,
               v = static_cast<double>(b >> 11) * 0x1p-53;
  return std::sqrt(-2 * std::log(u)) * std::cos(6.283185307179586 * v);
}

std::vector<FragmentChance> forecast_fragments(const MpmState& state, const Pieces& pieces,
                                               std::vector<StrainedPoint> strained,
                                               const FragmentNetwork& network,
                                               const FragmentClassifier& classifier) {
  const FragmentCandidates candidates = fragment_candidates(state, pieces, strained);
  if (candidates.points.empty()) return {};
  std::vector<FragmentChance> chances(candidates.points.size());
  const NetworkWeights own = network.classifier(), modifier = network.modifier();
  const auto threshold = static_cast<float>(network.threshold());
  const bool all = network.inputs() > kFeatureCount || classifier;
  const FragmentSurroundings around =
      all ? fragment_surroundings(state, pieces, std::move(strained)) : FragmentSurroundings();
  state.cpu->for_each(
      candidates.groups(),
      [&](int g) {
        float x[kAllFeatureCount];
        const std::int32_t begin = candidates.first[g], end = candidates.first[g + 1];
        const std::int32_t point = candidates.points[begin];
        fragment_features(state, point, x);
        if (all) surrounding_features(state, pieces, around, point, x);
        FragmentChance& c = chances[begin];
        c.probability = classifier ? classifier(state, point, x) : fragment_probability(own, x);
        c.time = state.time;
        c.expected = c.probability >= (classifier ? 0.5f : threshold);
        if (c.expected) expect_deformation(modifier, x, c);
        for (std::int32_t i = begin + 1; i < end; ++i) chances[i] = c;
        for (std::int32_t i = begin; i < end; ++i) chances[i].point = candidates.points[i];
      },
      8);
  std::sort(chances.begin(), chances.end(),
            [](const FragmentChance& a, const FragmentChance& b) { return a.point < b.point; });
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
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero(), deviation = mean;
  for (const FragmentChance& c : said) {
    if (pieces.of_point[c.point] != piece) continue;
    ++looked_at;
    if (!c.expected) continue;
    ++expected;
    for (int i = 0; i < 9; ++i) {
      mean(i / 3, i % 3) += c.F[i];
      deviation(i / 3, i % 3) += c.deviation[i];
    }
  }
  if (expected == 0 || 2 * expected < looked_at) return false;
  for (int i = 0; i < 9; ++i) {
    const auto counter = static_cast<std::uint64_t>(piece) * 9 + i;
    F(i / 3, i % 3) = (mean(i / 3, i % 3) +
                       deviation(i / 3, i % 3) * standard_normal(state.scene.seed, counter)) /
                      expected;
  }
  const float limit = least_tear_limit(body);
  if (!F.allFinite()) return false;
  F = within(F, limit > 0 ? 1 + kCandidateShare * (limit - 1) : 2);
  return true;
}

Foresight make_foresight(const Scene& scene) {
  Foresight foresight;
  if (scene.fragment_network != "off") {
    foresight.network =
        std::make_unique<FragmentNetwork>(resolve_path(scene.fragment_network, "fragment network"));
  }
  return foresight;
}

namespace {

std::vector<int> parted_pieces(const FrameResult& frame) {
  std::vector<int> parted = frame.tear_report.new_fragments;
  const auto add = [&](const CutReport& report) {
    parted.insert(parted.end(), report.new_fragments.begin(), report.new_fragments.end());
  };
  add(frame.blade_report);
  for (const CutReport& report : frame.cut_reports) add(report);
  return parted;
}

}  // namespace

bool may_fly(const FrameResult& frame, const Foresight& foresight) {
  return !foresight.waiting.empty() || !parted_pieces(frame).empty();
}

std::vector<int> let_fly(MpmState& state, const Pieces& pieces, const FrameResult& frame,
                         double duration, Foresight& foresight) {
  std::vector<int> fly;
  std::vector<WaitingFragment> left;
  for (const WaitingFragment& w : foresight.waiting) {
    if (touches_anything(state, pieces, w.piece)) {
      if (state.time < w.until) left.push_back(w);
      continue;
    }
    Eigen::Matrix3d F;
    for (int i = 0; i < 9; ++i) F(i / 3, i % 3) = w.F[i];
    if (take_off(state, pieces, w.piece, F)) fly.push_back(w.piece);
  }
  for (const int id : parted_pieces(frame)) {  // what they touch is not known before the next frame
    Eigen::Matrix3d F;
    if (!draw_deformation(state, pieces, id, foresight.said, F)) continue;
    WaitingFragment w;
    w.piece = id;
    w.until = state.time + std::max(foresight.network->horizon(), 1.5 * duration);
    for (int i = 0; i < 9; ++i) w.F[i] = F(i / 3, i % 3);
    left.push_back(w);
  }
  foresight.waiting = std::move(left);
  foresight.flown += static_cast<int>(fly.size());
  return fly;
}

void look_ahead(const MpmState& state, const Pieces& pieces, std::vector<StrainedPoint> strained,
                double duration, Foresight& foresight, FrameResult& result) {
  foresight.forecast = forecast_fragments(state, pieces, std::move(strained), *foresight.network,
                                          foresight.classifier);
  // A piece that comes off in a frame was predicted at the end of one before, however long it is.
  const double longest = std::max(foresight.network->horizon(), duration);
  remember(foresight.forecast, state.time - 1.001 * longest, foresight.said);
  result.fragment_candidates = static_cast<int>(foresight.forecast.size());
  result.fragment_points =
      static_cast<int>(std::count_if(foresight.forecast.begin(), foresight.forecast.end(),
                                     [](const FragmentChance& c) { return c.expected; }));
}

}  // namespace tissue_sim
