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

/// The blocks of a set with the lanes of each colour ordered so that eight that follow one another
/// rarely meet: greedy, among the next kAhead. Random order takes 2.7 turns for a vertex.
template <class Kind>
std::vector<ConstraintBlock<Kind>> spread_banks(const ConstraintSet<Kind>& set) {
  constexpr int kAhead = 48;
  std::vector<ConstraintBlock<Kind>> result(set.blocks.begin(), set.blocks.end());
  std::vector<std::int32_t> left;
  for (std::size_t colour = 0; colour + 1 < set.begin.size(); ++colour) {
    const std::int32_t begin = set.begin[colour] * kLanes, end = set.begin[colour + 1] * kLanes;
    left.clear();
    for (std::int32_t k = end; k > begin; --k) left.push_back(k - 1);  // the first one last
    int taken[Kind::kVertices][kBanks] = {}, most[Kind::kVertices] = {};
    for (std::int32_t to = begin; to < end; ++to) {
      if (to % kBanks == 0) {
        for (int i = 0; i < Kind::kVertices; ++i) {
          std::fill_n(taken[i], kBanks, 0);
          most[i] = 0;
        }
      }
      const auto ahead = std::min<std::size_t>(left.size(), kAhead);
      std::size_t best = left.size() - 1;
      int least = Kind::kVertices + 1;
      for (std::size_t a = 1; a <= ahead && least > 0; ++a) {
        const std::int32_t k = left[left.size() - a];
        int turns = 0;
        for (int i = 0; i < Kind::kVertices; ++i) {
          const int bank = set.blocks[k / kLanes].vertex[i][k % kLanes] % kBanks;
          turns += taken[i][bank] > 0 && taken[i][bank] >= most[i] ? 1 : 0;
        }
        if (turns < least) {
          least = turns;
          best = left.size() - a;
        }
      }
      const std::int32_t k = left[best];
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
      const ConstraintBlock<Kind>& from = set.blocks[k / kLanes];
      for (int i = 0; i < Kind::kVertices; ++i) {
        const std::int32_t vertex = from.vertex[i][k % kLanes];
        result[to / kLanes].vertex[i][to % kLanes] = vertex;
        most[i] = std::max(most[i], ++taken[i][vertex % kBanks]);
      }
      for (int i = 0; i < Kind::kNumbers; ++i) {
        result[to / kLanes].number[i][to % kLanes] = from.number[i][k % kLanes];
      }
    }
  }
  return result;
}

}  // namespace pbd
}  // namespace tissue_sim
