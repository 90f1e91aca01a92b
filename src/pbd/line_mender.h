// Lines between sections (sections.h) that few bends of a vertex cross.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Moves single vertices across the lines between the workers that `owner` names, so that vertices
/// beside a line have few bends across it: in the other phase they need as many passes. Each
/// constraint stays one worker's, here or there.
class LineMender {
 public:
  LineMender(const State& s, std::vector<std::int16_t>& owner,
             const std::vector<std::int16_t>& there)
      : owner_(owner), there_(there), of_(owner.size()), across_(owner.size(), 0) {
    for (const auto& v : s.bends.vertices) items_.push_back({v, true});
    for (int c = 0; c < s.edge_count; ++c) {
      const auto [a, b] = s.links.vertices[c];
      items_.push_back({{a, b, a, b}, false});
    }
    for (std::size_t c = 0; c < items_.size(); ++c) {
      const auto& v = items_[c].vertices;
      for (int i = 0; i < (items_[c].is_bend ? 4 : 2); ++i) of_[v[i]].push_back(c);
      count(items_[c], 1);
    }
  }
  void run() {
    bool moved = true;
    for (int round = 0; round < 4 && moved; ++round) {
      moved = false;
      for (std::size_t v = 0; v < owner_.size(); ++v) {
        if (across_[v] > 0 && move(v)) moved = true;
      }
    }
  }

 private:
  struct Item {
    std::array<std::int32_t, 4> vertices;
    bool is_bend;
  };
  static bool is_ones(const std::vector<std::int16_t>& owner, const Item& item) {
    const auto& v = item.vertices;
    return owner[v[0]] == owner[v[1]] && owner[v[0]] == owner[v[2]] && owner[v[0]] == owner[v[3]];
  }
  void count(const Item& item, int by) {
    if (!item.is_bend || is_ones(owner_, item)) return;
    for (const std::int32_t v : item.vertices) across_[v] += by;
  }
  /// Grows so fast that the vertex with most counts most.
  double weight(const std::vector<std::int32_t>& near) const {
    double sum = 0;
    for (const std::int32_t v : near) sum += std::ldexp(1, 2 * std::min(across_[v], 400));
    return sum;
  }
  /// If that lowers the weight.
  bool move(std::size_t v) {
    std::vector<std::int32_t> near;
    std::int16_t to = owner_[v];
    const std::int16_t was = to;
    for (const std::size_t c : of_[v]) {
      for (const std::int32_t w : items_[c].vertices) {
        near.push_back(w);
        if (owner_[w] != was) to = owner_[w];
      }
    }
    if (to == was) return false;
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    const double before = weight(near);
    take(v, to);
    bool is_better = weight(near) < before;
    for (const std::size_t c : of_[v]) {
      is_better = is_better && (is_ones(owner_, items_[c]) || is_ones(there_, items_[c]));
    }
    if (!is_better) take(v, was);
    return is_better;
  }
  void take(std::size_t v, std::int16_t to) {
    for (const std::size_t c : of_[v]) count(items_[c], -1);
    owner_[v] = to;
    for (const std::size_t c : of_[v]) count(items_[c], 1);
  }

  std::vector<std::int16_t>& owner_;
  const std::vector<std::int16_t>& there_;
  std::vector<Item> items_;
  std::vector<std::vector<std::size_t>> of_;
  std::vector<int> across_;  ///< bends of each vertex that cross a line
};

}  // namespace pbd
}  // namespace tissue_sim
