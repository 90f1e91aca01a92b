#include "mpm/linearised_motion.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "math/draw.h"

namespace tissue_sim {
namespace {

constexpr int kChunk = 2048;
}  // namespace

LinearisedMotion::~LinearisedMotion() {
  for (int a = 0; a < 3; ++a) {
    std::swap(u_[a], state_.nodes.u[a]);
    std::swap(rates_[a], state_.nodes.v[a]);
    std::swap(d_[a], state_.front.d[a]);
    std::swap(front_rates_[a], state_.front.rate[a]);
  }
}

template <class F>
double LinearisedMotion::sum(const F& f) {
  const int count = static_cast<int>(mass_.size()), chunks = (count + kChunk - 1) / kChunk;
  std::vector<double> part(chunks);
  state_.cpu->for_each(chunks, [&](int chunk) {
    double s = 0;
    const int end = std::min(count, (chunk + 1) * kChunk);
    for (int a = 0; a < 3; ++a) {
      for (int i = chunk * kChunk; i < end; ++i) s += f(a, i);
    }
    part[chunk] = s;
  });
  double s = 0;
  for (const double p : part) s += p;
  return s;
}

template <class F>
void LinearisedMotion::for_each(const F& f) {
  sum([&f](int a, int i) {
    f(a, i);
    return 0.0;
  });
}

template <class F>
double LinearisedMotion::accelerations(const F& f) {
  state_.cpu->for_each(static_cast<int>(blocks_.size()), [&](int i) {
    const Block& block = *state_.blocks.all[blocks_[i]];
    state_.kernels->forces(block, block_field(state_, block), state_.scratch.local(),
                           state_.work.force.data() + block.force_offset);
  });
  state_.cpu->for_each(static_cast<int>(front_cells_.size()),
                       [&](int i) { work_on_front_cell(state_, front_cells_[i]); });
  NodeStep step{};
  step.dt = step.kick = 1;  // from rest: rates are accelerations
  move_nodes(state_, step);
  for (const int group : held_) hold_still(state_.anchors, group, state_.nodes.v);
  return sum([&](int a, int i) {
    float& v = rate(a, i);
    const float x = v;
    v = 0;
    return f(a, i, x);
  });
}

LinearisedMotion::LinearisedMotion(MpmState& state, const std::vector<std::uint8_t>& takes_part)
    : state_(state) {
  Nodes& n = state.nodes;
  std::vector<std::uint8_t> seen(n.size(), 0);
  for (std::size_t i = 0; i < takes_part.size(); ++i) {
    if (takes_part[i] == 0) continue;
    blocks_.push_back(static_cast<int>(i));
    for (const std::int32_t node : state.blocks.all[i]->node) {
      if (node >= 0) seen[node] = 1;
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] == 0 || n.inv_mass[i] == 0) continue;
    nodes_.push_back(static_cast<std::int32_t>(i));
    mass_.push_back(n.mass[i]);
  }
  add_front(seen);
  const AnchorFaces& faces = state.anchors;
  for (std::size_t g = 0; g < faces.groups.size(); ++g) {
    bool all = true;
    for (int i = 0; i < faces.groups[g].count; ++i) {
      const FaceRow& row = faces.rows[faces.groups[g].first + i];
      for (int k = 0; k < kRowNodes; ++k) {
        all = all && (row.share[k] == 0 || seen[row.node[k]] != 0);
      }
    }
    if (all) held_.push_back(static_cast<int>(g));
  }
  for (int a = 0; a < 3; ++a) {
    u_[a] = n.u[a];
    rates_[a].assign(n.size(), 0.0f);
    std::swap(rates_[a], n.v[a]);
    for (Vector* x : {&at_rest_, &before_, &v_, &w_}) (*x)[a].assign(mass_.size(), 0.0f);
  }
  Front& front = state.front;
  for (int a = 0; a < 3; ++a) {
    d_[a] = front.d[a];
    front_rates_[a].assign(d_[a].size(), 0.0f);
    std::swap(front_rates_[a], front.rate[a]);
  }
  std::fill(front.force.begin(), front.force.end(), 0.0f);
  std::fill(front.pull.begin(), front.pull.end(), 0.0f);
  std::fill(state.work.force.begin(), state.work.force.end(), 0.0f);
  accelerations([this](int a, int i, float x) {
    at_rest_[a][i] = x;
    return 0.0;
  });
}

void LinearisedMotion::add_front(const std::vector<std::uint8_t>& seen) {
  const Front& front = state_.front;
  std::vector<std::uint8_t> takes_part(front.nodes.size(), 0);
  for (std::size_t i = 0; i < front.cells.size(); ++i) {
    const FrontCell& cell = front.cells[i];
    if (!std::all_of(cell.node, cell.node + 27, [&seen](int n) { return seen[n] != 0; })) continue;
    front_cells_.push_back(static_cast<int>(i));
    for (int j = 0; j < cell.count; ++j) takes_part[front.parts[cell.first + j].node] = 1;
  }
  for (std::size_t i = 0; i < takes_part.size(); ++i) {
    if (takes_part[i] == 0) continue;
    front_nodes_.push_back(static_cast<std::int32_t>(i));
    mass_.push_back(front.nodes[i].mass);
  }
}

float& LinearisedMotion::rate(int a, int i) {
  const auto first = static_cast<int>(nodes_.size());
  return i < first ? state_.nodes.v[a][nodes_[i]] : state_.front.rate[a][front_nodes_[i - first]];
}

void LinearisedMotion::start() {
  Nodes& n = state_.nodes;
  const auto first = static_cast<int>(nodes_.size());
  for_each([&](int a, int i) {
    const std::int32_t number = i < first ? nodes_[i] : ~front_nodes_[i - first];
    const float inv_mass = i < first ? n.inv_mass[number] : 1 / mass_[i];
    rate(a, i) = scattered(static_cast<std::uint32_t>(3 * number + a)) * std::sqrt(inv_mass);
  });
  for (const int group : held_) hold_still(state_.anchors, group, n.v);
  const double square = sum([&](int a, int i) {
    v_[a][i] = std::exchange(rate(a, i), 0.0f);
    return static_cast<double>(mass_[i]) * v_[a][i] * v_[a][i];
  });
  const auto scale = static_cast<float>(square > 0 ? 1 / std::sqrt(square) : 0);
  for_each([&](int a, int i) { v_[a][i] *= scale; });
}

double LinearisedMotion::apply() {
  std::int32_t bits = 0;  // of the largest: as integers they compare side by side
  for (const auto& component : v_) {
    for (const float x : component) {
      std::int32_t of_x;
      std::memcpy(&of_x, &x, sizeof(x));
      bits = std::max(bits, of_x & 0x7fffffff);
    }
  }
  float largest;
  std::memcpy(&largest, &bits, sizeof(bits));
  if (!(largest > 0)) return 0;
  const auto scale = kSmallMotion * static_cast<float>(state_.scene.cell_size) / largest;
  const auto first = static_cast<int>(nodes_.size());
  for_each([&](int a, int i) {
    if (i < first) {
      const std::int32_t node = nodes_[i];
      state_.nodes.u[a][node] = u_[a][node] + scale * v_[a][i];
    } else {
      const std::int32_t node = front_nodes_[i - first];
      state_.front.d[a][node] = d_[a][node] + scale * v_[a][i];
    }
  });
  const float back = 1 / scale;
  return accelerations([&](int a, int i, float x) {
    w_[a][i] = (at_rest_[a][i] - x) * back;
    return static_cast<double>(mass_[i]) * w_[a][i] * v_[a][i];
  });
}

double LinearisedMotion::orthogonalise(double along_v, double along_before) {
  const auto a = static_cast<float>(along_v), b = static_cast<float>(along_before);
  return std::sqrt(sum([&](int c, int i) {
    const float w = w_[c][i] - a * v_[c][i] - b * before_[c][i];
    w_[c][i] = w;
    return static_cast<double>(mass_[i]) * w * w;
  }));
}

void LinearisedMotion::next(double length) {
  const auto scale = static_cast<float>(1 / length);
  for (int a = 0; a < 3; ++a) {
    std::swap(before_[a], v_[a]);
    std::swap(v_[a], w_[a]);
  }
  for_each([&](int a, int i) { v_[a][i] *= scale; });
}

}  // namespace tissue_sim
