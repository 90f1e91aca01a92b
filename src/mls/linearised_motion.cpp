#include "mls/linearised_motion.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "math/lanczos.h"

namespace tissue_sim {

MlsLinearisedMotion::MlsLinearisedMotion(const MlsState& state, MlsForces forces)
    : s_(state), forces_(std::move(forces)) {
  const std::size_t n = state.count();
  for (Array<float>* a : {&at_rest_, &force_, &u_}) a->assign(state.u.size(), 0.0f);
  for (std::vector<double>* a : {&v_, &w_, &before_}) a->assign(4 * n, 0.0);
  root_.resize(n);
  float least = 1e30f;
  for (std::size_t i = 0; i < n; ++i) {
    root_[i] = std::sqrt(static_cast<double>(state.inv_mass[i]));
    least = std::min(least, state.edge[i]);
  }
  step_ = least / 64.0;
  forces_(state.u.data(), at_rest_.data());
}

void MlsLinearisedMotion::start() {
  std::mt19937 random(1);  // its numbers are the same everywhere, unlike those of distributions
  double sum = 0;
  for (std::size_t k = 0; k < v_.size(); ++k) {
    v_[k] = k % 4 == 3 || root_[k / 4] == 0 ? 0 : random() * 0x1p-31 - 1;
    sum += v_[k] * v_[k];
  }
  for (double& x : v_) x /= sum > 0 ? std::sqrt(sum) : 1;
}

double MlsLinearisedMotion::apply() {
  double farthest = 0;
  for (std::size_t k = 0; k < v_.size(); ++k) {
    farthest = std::max(farthest, std::fabs(v_[k] * root_[k / 4]));
  }
  if (farthest == 0) return 0;
  const double scale = step_ / farthest;
  for (std::size_t k = 0; k < v_.size(); ++k) {
    u_[k] = s_.u[k] + static_cast<float>(scale * v_[k] * root_[k / 4]);
  }
  forces_(u_.data(), force_.data());
  double product = 0;
  for (std::size_t k = 0; k < v_.size(); ++k) {
    w_[k] = -root_[k / 4] * (static_cast<double>(force_[k]) - at_rest_[k]) / scale;
    product += v_[k] * w_[k];
  }
  return product;
}

double MlsLinearisedMotion::orthogonalise(double a, double b) {
  double sum = 0;
  for (std::size_t k = 0; k < v_.size(); ++k) {
    w_[k] -= a * v_[k] + b * before_[k];
    sum += w_[k] * w_[k];
  }
  return std::sqrt(sum);
}

void MlsLinearisedMotion::next(double b) {
  before_ = v_;
  for (std::size_t k = 0; k < v_.size(); ++k) v_[k] = w_[k] / b;
}

double measured_limit(const MlsState& state, const MlsForces& forces, int steps) {
  MlsLinearisedMotion motion(state, forces);
  return 2 / std::sqrt(largest_eigenvalue(motion, steps));
}

}  // namespace tissue_sim
