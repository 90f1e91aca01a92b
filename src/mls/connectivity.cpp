#include "mls/connectivity.h"

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
void make_clusters(const MlsNodes& nodes, const MlsPairs& pairs, MlsConnectivity& connectivity) {
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
  connectivity.cluster.assign(n, 0);
  std::vector<std::vector<std::int32_t>> members;
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t lowest = linked.root(i);
    if (lowest == i) members.emplace_back();
    connectivity.cluster[i] =
        lowest == i ? static_cast<std::int32_t>(members.size()) - 1 : connectivity.cluster[lowest];
    members[connectivity.cluster[i]].push_back(i);
  }
  std::vector<std::int32_t> neighbours;
  connectivity.members_begin.push_back(0);
  connectivity.neighbours_begin.push_back(0);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(members.size()); ++c) {
    neighbours.clear();
    for (const std::int32_t i : members[c]) {
      connectivity.members.push_back(i);
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        const std::int32_t other = connectivity.cluster[pairs.other[e]];
        if (other > c) neighbours.push_back(other);
      }
    }
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
    for (const std::int32_t other : neighbours) connectivity.neighbours.push_back(other);
    connectivity.members_begin.push_back(static_cast<std::int32_t>(connectivity.members.size()));
    connectivity.neighbours_begin.push_back(
        static_cast<std::int32_t>(connectivity.neighbours.size()));
  }
}

/// Components of nodes; the root of each is its lowest.
class Links {
 public:
  explicit Links(std::int32_t nodes) : parent_(nodes) {}
  /// Before any join: a lower one of its component, or itself.
  void begin(std::int32_t node, std::int32_t parent) { parent_[node] = parent; }
  /// Most often: a look at whether there is something to do.
  bool apart(std::int32_t a, std::int32_t b) const { return parent_[a] != parent_[b]; }
  void join(std::int32_t a, std::int32_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  UnionFind flat() && {
    for (std::int32_t& parent : parent_) parent = parent_[parent];
    return UnionFind(std::move(parent_));
  }

 private:
  std::int32_t root(std::int32_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  std::vector<std::int32_t> parent_;
};

}  // namespace

MlsConnectivity make_connectivity(const MlsNodes& nodes, const MlsPairs& pairs) {
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
  MlsConnectivity connectivity;
  connectivity.begin.push_back(0);
  for (std::int32_t i = 0; i < pairs.nodes(); ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      if (is_in[e] != 0) connectivity.other.push_back(pairs.other[e]);
    }
    connectivity.begin.push_back(static_cast<std::int32_t>(connectivity.other.size()));
  }
  make_clusters(nodes, pairs, connectivity);
  return connectivity;
}

UnionFind join_uncrossed(const MlsState& s) {
  constexpr std::int32_t kAhead =
      16;  // entries are asked for from memory: that is what this waits for
  const MlsPairs& p = s.pairs;
  const MlsConnectivity& connectivity = s.connectivity;
  const std::int32_t n = s.count(),
                     clusters = static_cast<std::int32_t>(connectivity.members_begin.size()) - 1;
  const auto first_of = [&](std::int32_t c) {
    return connectivity.members[connectivity.members_begin[c]];
  };
  // Of each cluster its lowest node, which is its first; -1 where it is cut.
  std::vector<std::int32_t> whole(clusters);
  for (std::int32_t c = 0; c < clusters; ++c) whole[c] = first_of(c);
  for (std::int32_t i = 0; i < n; ++i) {
    if (s.cut[i] != 0) whole[connectivity.cluster[i]] = -1;
  }
  // Whole clusters first, and with one another.
  Links linked(n);
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t lowest = whole[connectivity.cluster[i]];
    linked.begin(i, lowest < 0 ? i : lowest);
  }
  for (std::int32_t c = 0; c < clusters; ++c) {
    if (whole[c] < 0) continue;
    for (std::int32_t k = connectivity.neighbours_begin[c];
         k < connectivity.neighbours_begin[c + 1]; ++k) {
      const std::int32_t other = whole[connectivity.neighbours[k]];
      if (other >= 0 && linked.apart(whole[c], other)) linked.join(whole[c], other);
    }
  }
  for (std::int32_t c = 0; c < clusters; ++c) {
    if (whole[c] >= 0) continue;
    const std::int32_t last = connectivity.members_begin[c + 1];
    for (std::int32_t k = connectivity.members_begin[c]; k < last; ++k) {
      if (k + kAhead < last) {
        const std::int32_t next = connectivity.members[k + kAhead];
        if (s.cut[next] != 0) {
          __builtin_prefetch(&p.other[p.begin[next]]);
          __builtin_prefetch(&p.other[p.begin[next]] + 16);
          __builtin_prefetch(&p.crossed[p.begin[next]]);
        } else {
          __builtin_prefetch(&connectivity.other[connectivity.begin[next]]);
        }
      }
      const std::int32_t i = connectivity.members[k];
      if (s.cut[i] != 0) {
        for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
          // Both are looked at before either decides: few are neither.
          if ((p.crossed[e] == 0) & linked.apart(i, p.other[e])) linked.join(i, p.other[e]);
        }
        continue;
      }
      for (std::int32_t m = connectivity.begin[i]; m < connectivity.begin[i + 1]; ++m) {
        if (linked.apart(i, connectivity.other[m])) linked.join(i, connectivity.other[m]);
      }
    }
  }
  return std::move(linked).flat();
}

}  // namespace tissue_sim
