#include "mls/spanner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "mls/state.h"

namespace tissue_sim {
namespace {

constexpr double kNodesOfCluster = 64;

/// Cubes of about so many nodes, and in them what hangs together.
void make_clusters(const MlsNodes& nodes, const MlsPairs& pairs, MlsSpanner& spanner) {
  const std::int32_t n = pairs.nodes();
  std::vector<std::array<std::int32_t, 4>> cube(n);  // and the body
  for (std::int32_t first = 0; first < n;) {
    std::int32_t last = first;
    double volume = 0;
    for (; last < n && nodes.body[last] == nodes.body[first]; ++last) volume += nodes.volume[last];
    const double edge = std::cbrt(kNodesOfCluster * volume / (last - first));
    for (std::int32_t i = first; i < last; ++i) {
      for (int a = 0; a < 3; ++a) {
        cube[i][a] = static_cast<std::int32_t>(std::floor(nodes.place[i][a] / edge));
      }
      cube[i][3] = nodes.body[i];
    }
    first = last;
  }
  UnionFind linked(n);
  for (std::int32_t i = 0; i < n; ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      if (cube[pairs.other[e]] == cube[i]) linked.join(i, pairs.other[e]);
    }
  }
  spanner.cluster.assign(n, 0);
  std::vector<std::vector<std::int32_t>> members;
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t lowest = linked.root(i);
    if (lowest == i) members.emplace_back();
    spanner.cluster[i] =
        lowest == i ? static_cast<std::int32_t>(members.size()) - 1 : spanner.cluster[lowest];
    members[spanner.cluster[i]].push_back(i);
  }
  std::vector<std::int32_t> neighbours;
  spanner.members_begin.push_back(0);
  spanner.neighbours_begin.push_back(0);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(members.size()); ++c) {
    neighbours.clear();
    for (const std::int32_t i : members[c]) {
      spanner.members.push_back(i);
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        const std::int32_t other = spanner.cluster[pairs.other[e]];
        if (other > c) neighbours.push_back(other);
      }
    }
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
    for (const std::int32_t other : neighbours) spanner.neighbours.push_back(other);
    spanner.members_begin.push_back(static_cast<std::int32_t>(spanner.members.size()));
    spanner.neighbours_begin.push_back(static_cast<std::int32_t>(spanner.neighbours.size()));
  }
}

}  // namespace

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
    is_in[link.entry] = is_in[pairs.twin[link.entry]] = 1;
  }
  MlsSpanner spanner;
  spanner.begin.push_back(0);
  for (std::int32_t i = 0; i < pairs.nodes(); ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      if (is_in[e] != 0) spanner.entry.push_back(e);
    }
    spanner.begin.push_back(static_cast<std::int32_t>(spanner.entry.size()));
  }
  make_clusters(nodes, pairs, spanner);
  return spanner;
}

UnionFind join_uncrossed(const MlsState& s) {
  const MlsPairs& p = s.pairs;
  const MlsSpanner& spanner = s.spanner;
  const auto clusters = static_cast<std::int32_t>(spanner.members_begin.size()) - 1;
  std::vector<std::uint8_t> is_cut(clusters, 0);
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.cut[i] != 0) is_cut[spanner.cluster[i]] = 1;
  }
  // Whole clusters first, and with one another: of each, its lowest node is the first.
  std::vector<std::int32_t> lowest(s.count());
  for (std::int32_t i = 0; i < s.count(); ++i) {
    const std::int32_t c = spanner.cluster[i];
    lowest[i] = is_cut[c] != 0 ? i : spanner.members[spanner.members_begin[c]];
  }
  UnionFind linked(std::move(lowest));
  for (std::int32_t c = 0; c < clusters; ++c) {
    const std::int32_t* members = &spanner.members[spanner.members_begin[c]];
    if (is_cut[c] == 0) {
      for (std::int32_t k = spanner.neighbours_begin[c]; k < spanner.neighbours_begin[c + 1]; ++k) {
        const std::int32_t other = spanner.neighbours[k];
        if (is_cut[other] == 0) {
          linked.join(*members, spanner.members[spanner.members_begin[other]]);
        }
      }
      continue;
    }
    for (std::int32_t k = spanner.members_begin[c]; k < spanner.members_begin[c + 1]; ++k) {
      const std::int32_t i = spanner.members[k];
      if (s.cut[i] != 0) {
        for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
          const std::int32_t j = p.other[e];
          if (p.crossed[e] != 0 || (j < i && s.cut[j] != 0)) continue;  // that one joins it
          linked.join(i, j);
        }
        continue;
      }
      for (std::int32_t m = spanner.begin[i]; m < spanner.begin[i + 1]; ++m) {
        const std::int32_t j = p.other[spanner.entry[m]];
        if (s.cut[j] != 0 || (j < i && is_cut[spanner.cluster[j]] != 0)) continue;  // the same
        linked.join(i, j);
      }
    }
  }
  return linked;
}

}  // namespace tissue_sim
