// The order of a colour's constraints that reads shared memory fastest.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "pbd/constraint_set.h"

namespace tissue_sim {
namespace pbd {

/// Shared memory hands eight threads 16 bytes each at once where they read from eight different
/// places of 128 bytes; each two that want the same one cost a turn. Within a colour any order
/// gives the same bits.
inline constexpr int kBanks = 8;

/// An order of `count` constraints, of which vertex(k, i) is the i-th of kVertices vertices, in
/// which eight that follow one another rarely meet: greedy, among the next kAhead. Random order
/// takes 2.7 turns for a vertex.
template <int kVertices, class F>
std::vector<std::int32_t> spread_order(std::int32_t count, const F& vertex) {
  constexpr int kAhead = 48;
  std::vector<std::int32_t> left, order;
  for (std::int32_t k = count; k > 0; --k) left.push_back(k - 1);  // the first one last
  int taken[kVertices][kBanks] = {}, most[kVertices] = {};
  while (!left.empty()) {
    if (order.size() % kBanks == 0) {
      for (int i = 0; i < kVertices; ++i) {
        std::fill_n(taken[i], kBanks, 0);
        most[i] = 0;
      }
    }
    const auto ahead = std::min<std::size_t>(left.size(), kAhead);
    std::size_t best = left.size() - 1;
    int least = kVertices + 1;
    for (std::size_t a = 1; a <= ahead && least > 0; ++a) {
      const std::int32_t k = left[left.size() - a];
      int turns = 0;
      for (int i = 0; i < kVertices; ++i) {
        const int bank = vertex(k, i) % kBanks;
        turns += taken[i][bank] > 0 && taken[i][bank] >= most[i] ? 1 : 0;
      }
      if (turns < least) {
        least = turns;
        best = left.size() - a;
      }
    }
    const std::int32_t k = left[best];
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
    for (int i = 0; i < kVertices; ++i) {
      most[i] = std::max(most[i], ++taken[i][vertex(k, i) % kBanks]);
    }
    order.push_back(k);
  }
  return order;
}

/// The blocks of a set with the lanes of each colour in that order.
template <class Kind>
std::vector<ConstraintBlock<Kind>> spread_banks(const ConstraintSet<Kind>& set) {
  std::vector<ConstraintBlock<Kind>> result(set.blocks.begin(), set.blocks.end());
  for (std::size_t colour = 0; colour + 1 < set.begin.size(); ++colour) {
    const std::int32_t begin = set.begin[colour] * kLanes, end = set.begin[colour + 1] * kLanes;
    std::int32_t to = begin;
    for (const std::int32_t of : spread_order<Kind::kVertices>(end - begin, [&](int k, int i) {
           return set.blocks[(begin + k) / kLanes].vertex[i][(begin + k) % kLanes];
         })) {
      const std::int32_t k = begin + of;
      const ConstraintBlock<Kind>& from = set.blocks[k / kLanes];
      for (int i = 0; i < Kind::kVertices; ++i) {
        result[to / kLanes].vertex[i][to % kLanes] = from.vertex[i][k % kLanes];
      }
      for (int i = 0; i < Kind::kNumbers; ++i) {
        result[to / kLanes].number[i][to % kLanes] = from.number[i][k % kLanes];
      }
      ++to;
    }
  }
  return result;
}

}  // namespace pbd
}  // namespace tissue_sim
