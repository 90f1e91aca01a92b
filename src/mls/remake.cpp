#include "mls/remake.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "mls/own_rate.h"

namespace tissue_sim {
namespace {

/// Least eigenvalue of a moment matrix over its largest, below which a support spans no space: a
/// sheet, a chain, a pair or nothing. The paper's matrix is never regularised: with the identity
/// left for what it does not see, a rotation would be a strain.
constexpr double kSpans = 0.02;

bool spans_space(const Eigen::Matrix3d& m) {
  // Of eigenvalues a <= b <= c, sums t = a + b + c and q = ab + bc + ca: abc / (q t) <= a / c <= 9
  // abc / (q t). For most that tells.
  const double t = m.trace(), q = 0.5 * (t * t - m.squaredNorm()), product = m.determinant();
  if (!(3 * q > kSpans * t * t)) return false;  // b / c at most; and q is no rounding
  if (product > kSpans * q * t) return true;
  if (!(9 * product > kSpans * q * t)) return false;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(m, Eigen::EigenvaluesOnly);
  const double least = eigen.eigenvalues()[0], largest = eigen.eigenvalues()[2];
  return largest > 0 && least > kSpans * largest;
}

/// Springs from a sprung node to its neighbours: each carries its share of what a bar through the
/// node's volume would, or a sheet, of which springs all around bear a third along each way.
void make_springs(MlsState& s, std::int32_t i) {
  if (s.spring.empty()) {
    s.spring.swap(s.spring_room);
    s.spring.resize(s.pairs.other.size(), 0.0f);  // where the room went, and a state was restored
  }
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const Vec3 r = s.nodes.place[s.pairs.other[e]] - s.nodes.place[i];
    m += s.pairs.weight[e] * r * r.transpose();
  }
  const double sum = m.trace(), wide = sum > 0 ? 2 * sum * sum / m.squaredNorm() - 1 : 1;  // 1 to 3
  const double stiffness = wide * s.nodes.material_of(i).young_modulus * s.nodes.volume[i];
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    s.spring[e] =
        s.pairs.weight[e] > 0 ? static_cast<float>(stiffness * s.pairs.weight[e] / sum) : 0.0f;
  }
}

}  // namespace

void remake_support(MlsState& s, std::int32_t i) {
  const MlsSums sums = mls_sums(s, i);
  const double* of = sums.moment;
  Eigen::Matrix3d m;
  m << of[0], of[3], of[4], of[3], of[1], of[5], of[4], of[5], of[2];
  const bool spans = spans_space(m);
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  if (spans) inverse = m.inverse();
  for (int k = 0; k < 6; ++k) {
    constexpr int kRow[] = {0, 1, 2, 0, 0, 1}, kColumn[] = {0, 1, 2, 1, 2, 2};
    s.inverse_moment[k][i] = static_cast<float>(inverse(kRow[k], kColumn[k]));
  }
  if (spans && s.sprung[i] != 0 && !s.spring.empty()) {
    std::fill(&s.spring[s.pairs.begin[i]], s.spring.data() + s.pairs.begin[i + 1], 0.0f);
  }
  s.kappa[i] = spans ? s.whole_kappa[i] : 0.0f;
  s.sprung[i] = spans ? 0 : 1;
  put_strained_volume(s, i, strained_volume(s, i, sums));
}

void put_strained_volume(MlsState& s, std::int32_t i, float volume) {
  const Material& m = s.nodes.material_of(i);
  s.volume_mu[i] = static_cast<float>(lame_mu(m)) * volume;
  s.volume_lambda[i] = static_cast<float>(lame_lambda(m)) * volume;
  s.volume_eta[i] = static_cast<float>(m.viscosity) * volume;
}

void remake_springs(MlsState& s, const std::vector<std::int32_t>& nodes) {
  for (const std::int32_t i : nodes) {
    if (s.sprung[i] != 0) make_springs(s, i);
  }
  s.springs.begin.clear();
}

void remake(MlsState& s, const std::vector<std::int32_t>& nodes) {
  s.cpu->for_each(
      static_cast<int>(nodes.size()), [&](int k) { remake_support(s, nodes[k]); }, 64);
  remake_springs(s, nodes);
}

}  // namespace tissue_sim
