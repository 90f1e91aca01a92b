#include "mpm/cuda/bundle_blocks.h"

#include <algorithm>
#include <numeric>

namespace tissue_sim {

std::size_t fewest_bundles(const std::vector<BlockToBundle>& blocks, const BundleSize& limits) {
  std::size_t columns = 0;
  for (const BlockToBundle& b : blocks) columns += b.size.columns;
  return (columns + limits.columns - 1) / limits.columns;
}

std::vector<std::vector<int>> bundle_blocks(const std::vector<BlockToBundle>& blocks,
                                            std::size_t wanted, const BundleSize& limits) {
  std::vector<int> order(blocks.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&blocks](int a, int b) {
    return blocks[a].size.columns > blocks[b].size.columns;
  });
  std::vector<BlockToBundle> bundles;
  std::vector<std::vector<int>> result;
  for (const int i : order) {
    const BlockToBundle& one = blocks[i];
    std::size_t room = bundles.size();
    for (std::size_t k = 0; bundles.size() >= wanted && k < bundles.size(); ++k) {
      const BundleSize& has = bundles[k].size;
      const bool fits = bundles[k].kind == one.kind &&
                        has.columns + one.size.columns <= limits.columns &&
                        has.plane_slots + one.size.plane_slots <= limits.plane_slots &&
                        has.slots + one.size.slots <= limits.slots;
      if (fits && (room == bundles.size() || has.columns < bundles[room].size.columns)) room = k;
    }
    if (room == bundles.size()) {
      bundles.push_back(one);
      result.push_back({i});
      continue;
    }
    BundleSize& size = bundles[room].size;
    size.columns += one.size.columns;
    size.plane_slots += one.size.plane_slots;
    size.slots += one.size.slots;
    result[room].push_back(i);
  }
  return result;
}

std::vector<std::vector<int>> bundle_in_rounds(const std::vector<BlockToBundle>& blocks,
                                               std::size_t at_once, std::size_t most,
                                               const BundleSize& limits) {
  std::size_t wanted = (fewest_bundles(blocks, limits) + at_once - 1) / at_once * at_once;
  for (; wanted <= most && wanted < blocks.size(); wanted += at_once) {
    std::vector<std::vector<int>> bundles = bundle_blocks(blocks, wanted, limits);
    if (bundles.size() <= wanted) return bundles;
  }
  return {};
}

}  // namespace tissue_sim
