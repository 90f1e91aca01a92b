#include "mls/spanner.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "mls/state.h"

namespace tissue_sim {

MlsSpanner make_spanner(const MlsNodes& nodes, const MlsPairs& pairs) {
  struct Link {
    float length2;
    std::int32_t node, entry;
  };
  std::vector<Link> links;
  links.reserve(pairs.other.size() / 2);
  for (std::int32_t i = 0; i < pairs.nodes(); ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      const std::int32_t j = pairs.other[e];
      if (j < i) continue;
      links.push_back({static_cast<float>((nodes.place[j] - nodes.place[i]).squaredNorm()), i, e});
    }
  }
  std::sort(links.begin(), links.end(), [](const Link& a, const Link& b) {
    return std::tie(a.length2, a.entry) < std::tie(b.length2, b.entry);
  });
  std::vector<std::vector<std::int32_t>> of(pairs.nodes());  // who a node is linked to
  std::vector<std::uint8_t> is_in(pairs.other.size(), 0);
  for (const Link& link : links) {
    std::vector<std::int32_t>&a = of[link.node], &b = of[pairs.other[link.entry]];
    if (std::find_first_of(a.begin(), a.end(), b.begin(), b.end()) != a.end()) continue;
    a.push_back(pairs.other[link.entry]);
    b.push_back(link.node);
    is_in[link.entry] = 1;
  }
  MlsSpanner spanner;
  spanner.begin.push_back(0);
  for (std::int32_t i = 0; i < pairs.nodes(); ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      if (is_in[e] != 0) spanner.entry.push_back(e);
    }
    spanner.begin.push_back(static_cast<std::int32_t>(spanner.entry.size()));
  }
  return spanner;
}

UnionFind join_uncrossed(const MlsState& s) {
  const MlsPairs& p = s.pairs;
  const MlsSpanner& spanner = s.spanner;
  // Within blocks side by side, which touch nothing of one another; then between them. The root of
  // a component is its lowest node whatever the order.
  constexpr std::int32_t kLeast = 2048;
  UnionFind linked(s.count());
  const std::int32_t block_size =
      std::max<std::int32_t>(kLeast, s.count() / (2 * s.cpu->threads()) + 1);
  const int blocks = (s.count() + block_size - 1) / block_size;
  const auto join = [&](int block, bool within) {
    const std::int32_t first = block * block_size, last = std::min(s.count(), first + block_size);
    const auto join_entry = [&](std::int32_t i, std::int32_t e) {
      const std::int32_t j = p.other[e];
      if ((j >= first && j < last) == within && p.crossed[e] == 0) linked.join(i, j);
    };
    for (std::int32_t i = first; i < last; ++i) {
      if (s.cut[i] != 0) {
        for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) join_entry(i, e);
      } else {
        for (std::int32_t k = spanner.begin[i]; k < spanner.begin[i + 1]; ++k) {
          join_entry(i, spanner.entry[k]);
        }
      }
    }
  };
  s.cpu->for_each(blocks, [&](int block) { join(block, true); });
  for (int block = 0; block < blocks; ++block) join(block, false);
  return linked;
}

}  // namespace tissue_sim
