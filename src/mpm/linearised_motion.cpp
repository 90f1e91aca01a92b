#include "mpm/linearised_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mpm/small_motion.h"

namespace tissue_sim {
namespace {

constexpr int kChunk = 4096;
}  // namespace

LinearisedMotion::LinearisedMotion(MpmState& state, const std::vector<std::uint8_t>& takes_part)
    : state_(state), count_(state.nodes.size()) {
  Nodes& n = state.nodes;
  for (int a = 0; a < 3; ++a) {
    u_[a] = n.u[a];
    rates_[a].assign(count_, 0.0f);
    std::swap(rates_[a], n.v[a]);
    for (Vector* x : {&at_rest_, &before_, &v_, &w_}) (*x)[a].assign(count_, 0.0f);
  }
  std::fill(state.force.begin(), state.force.end(), 0.0f);
  for (std::size_t i = 0; i < takes_part.size(); ++i) {
    if (takes_part[i] != 0) blocks_.push_back(static_cast<int>(i));
  }
  accelerations(at_rest_);
}

LinearisedMotion::~LinearisedMotion() {
  for (int a = 0; a < 3; ++a) {
    std::swap(u_[a], state_.nodes.u[a]);
    std::swap(rates_[a], state_.nodes.v[a]);
  }
}

template <class F>
double LinearisedMotion::sum(const F& f) {
  const int chunks = static_cast<int>((count_ + kChunk - 1) / kChunk);
  std::vector<double> part(chunks);
  state_.cpu->for_each(chunks, [&](int chunk) {
    double s = 0;
    const std::size_t end = std::min(count_, static_cast<std::size_t>(chunk + 1) * kChunk);
    for (std::size_t i = static_cast<std::size_t>(chunk) * kChunk; i < end; ++i) {
      for (int a = 0; a < 3; ++a) s += f(a, i);
    }
    part[chunk] = s;
  });
  double s = 0;
  for (const double p : part) s += p;
  return s;
}

template <class F>
void LinearisedMotion::for_each(const F& f) {
  sum([&f](int a, std::size_t i) {
    f(a, i);
    return 0.0;
  });
}

void LinearisedMotion::accelerations(Vector& out) {
  state_.cpu->for_each(static_cast<int>(blocks_.size()), [&](int i) {
    const Block& block = *state_.blocks.all[blocks_[i]];
    state_.kernels->forces(block, block_field(state_, block), state_.scratch.local(),
                           state_.force.data() + block.force_offset);
  });
  NodeStep step{};
  step.dt = 1;  // from rest: rates are accelerations
  move_nodes(state_, step);
  for (int a = 0; a < 3; ++a) {
    out[a] = state_.nodes.v[a];
    std::fill(state_.nodes.v[a].begin(), state_.nodes.v[a].end(), 0.0f);
  }
}

void LinearisedMotion::start() {
  std::vector<std::uint8_t> sees(count_, 0);
  for (const int i : blocks_) {
    for (const std::int32_t n : state_.blocks.all[i]->node) sees[n] = 1;
  }
  const Nodes& n = state_.nodes;
  const double square = sum([&](int a, std::size_t i) {
    const bool moves = sees[i] != 0 && n.inv_mass[i] > 0;
    v_[a][i] =
        moves ? scattered(static_cast<std::uint32_t>(3 * i + a)) * std::sqrt(n.inv_mass[i]) : 0.0f;
    return static_cast<double>(n.mass[i]) * v_[a][i] * v_[a][i];
  });
  const auto scale = static_cast<float>(square > 0 ? 1 / std::sqrt(square) : 0);
  for_each([&](int a, std::size_t i) { v_[a][i] *= scale; });
}

double LinearisedMotion::apply() {
  float largest = 0;
  for (const auto& component : v_) {
    for (const float x : component) largest = std::max(largest, std::fabs(x));
  }
  if (!(largest > 0)) return 0;
  const auto scale = kSmallMotion * static_cast<float>(state_.scene.cell_size) / largest;
  Nodes& n = state_.nodes;
  for_each([&](int a, std::size_t i) { n.u[a][i] = u_[a][i] + scale * v_[a][i]; });
  accelerations(w_);
  const float back = 1 / scale;
  return sum([&](int a, std::size_t i) {
    w_[a][i] = (at_rest_[a][i] - w_[a][i]) * back;
    return static_cast<double>(n.mass[i]) * w_[a][i] * v_[a][i];
  });
}

double LinearisedMotion::orthogonalise(double along_v, double along_before) {
  const auto a = static_cast<float>(along_v), b = static_cast<float>(along_before);
  return std::sqrt(sum([&](int c, std::size_t i) {
    const float w = w_[c][i] - a * v_[c][i] - b * before_[c][i];
    w_[c][i] = w;
    return static_cast<double>(state_.nodes.mass[i]) * w * w;
  }));
}

void LinearisedMotion::next(double length) {
  const auto scale = static_cast<float>(1 / length);
  for (int a = 0; a < 3; ++a) {
    std::swap(before_[a], v_[a]);
    std::swap(v_[a], w_[a]);
  }
  for_each([&](int a, std::size_t i) { v_[a][i] *= scale; });
}

}  // namespace tissue_sim
