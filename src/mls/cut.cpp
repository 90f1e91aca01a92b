#include "mls/cut.h"

#include <algorithm>

#include "cutting/blade_sweep.h"

namespace tissue_sim {
namespace {

struct Moving {
  Vec3 from, to;
};

Moving moving(const MlsState& s, std::int32_t i, const float* u_begin, const float* u_end) {
  const Vec3 x(s.place[4 * i], s.place[4 * i + 1], s.place[4 * i + 2]);
  return {x + Vec3(u_begin[4 * i], u_begin[4 * i + 1], u_begin[4 * i + 2]),
          x + Vec3(u_end[4 * i], u_end[4 * i + 1], u_end[4 * i + 2])};
}

/// On which sides of what an edge sweeps a node stays: a bit for each side of each slab.
std::uint8_t outside_of(const SweptEdge& edge, const Moving& node) {
  unsigned outside = 0;
  for (int k = 0; k < 3; ++k) {
    const Slab& slab = edge.slabs[k];
    const double a = slab.axis.dot(node.from), b = slab.axis.dot(node.to);
    if (std::max(a, b) < slab.low) outside |= 1u << 2 * k;
    if (std::min(a, b) > slab.high) outside |= 2u << 2 * k;
  }
  return static_cast<std::uint8_t>(outside);
}

/// How many common neighbours a pair has, and how many to which both have an uncrossed pair.
struct Common {
  int all = 0, whole = 0;
};

Common common_neighbours(const MlsPairs& p, std::int32_t i, std::int32_t j) {
  Common common;
  std::int32_t a = p.begin[i], b = p.begin[j];
  const std::int32_t a_end = p.begin[i + 1], b_end = p.begin[j + 1];
  while (a < a_end && b < b_end) {
    if (p.other[a] < p.other[b]) {
      ++a;
    } else if (p.other[b] < p.other[a]) {
      ++b;
    } else {
      ++common.all;
      if (p.crossed[a] == 0 && p.crossed[b] == 0) ++common.whole;
      ++a, ++b;
    }
  }
  return common;
}

}  // namespace

void cross_entries(MlsState& s, const std::vector<std::int32_t>& entries,
                   std::vector<std::int32_t>& changed, CutReport& report) {
  MlsPairs& p = s.pairs;
  std::vector<std::int32_t> touched;
  for (const std::int32_t e : entries) {
    if (p.crossed[e] != 0) continue;
    const std::int32_t twin = p.twin[e];
    p.crossed[e] = p.crossed[twin] = 1;
    ++report.bonds_broken;
    touched.push_back(p.other[e]);
    touched.push_back(p.other[twin]);
  }
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  if (touched.empty()) return;
  report.points_separated += static_cast<int>(touched.size());
  changed.insert(changed.end(), touched.begin(), touched.end());
  // Pairs of a touched node: of any other, all common neighbours are as they were.
  std::vector<std::vector<std::int32_t>> fallen(touched.size());
  s.cpu->for_each(
      static_cast<int>(touched.size()),
      [&](int k) {
        const std::int32_t i = touched[k];
        expose(s, i);
        for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
          if (p.crossed[e] == 0) continue;
          const std::int32_t j = p.other[e];
          const bool both = std::binary_search(touched.begin(), touched.end(), j);
          if (both && j < i) continue;  // its turn comes with j
          const Common common = common_neighbours(p, i, j);
          const float left =
              common.all > 0 ? std::min(1.0f, 2.0f * common.whole / common.all) : 0.0f;
          const float weight = left * p.whole[e];
          if (weight == p.weight[e]) continue;
          p.weight[e] = p.weight[p.twin[e]] = weight;
          put_weight(p, e, s.lanes);
          put_weight(p, p.twin[e], s.lanes);
          fallen[k].push_back(i);
          fallen[k].push_back(j);
        }
      },
      16);
  std::vector<std::int32_t> nodes;
  for (const auto& some : fallen) nodes.insert(nodes.end(), some.begin(), some.end());
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  remake(s, nodes);
}

void cross_pairs(MlsState& s, const BladePath& path, const float* u_begin, const float* u_end,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  const MlsPairs& p = s.pairs;
  const int n = s.count(), groups = s.groups();
  std::vector<std::uint8_t> outside(n);
  std::vector<std::int32_t> crossed;
  for (const SweepPart& part : sweep_parts(path)) {
    for (const SweptEdge& edge : part.edges) {
      s.cpu->for_each(
          groups,
          [&](int group) {
            const int first = group * kMlsGroup, last = std::min(n, first + kMlsGroup);
            for (int i = first; i < last; ++i) {
              outside[i] = outside_of(edge, moving(s, i, u_begin, u_end));
            }
          },
          4);
      std::vector<std::vector<std::int32_t>> found(groups);
      s.cpu->for_each(
          groups,
          [&](int group) {
            const int first = group * kMlsGroup, last = std::min(n, first + kMlsGroup);
            for (int i = first; i < last; ++i) {
              const std::uint8_t own = outside[i];
              for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
                const std::int32_t j = p.other[e];
                if (j < i || (own & outside[j]) != 0 || p.crossed[e] != 0) continue;
                const Moving a = moving(s, i, u_begin, u_end), b = moving(s, j, u_begin, u_end);
                const MovingSegment link =
                    MovingSegment{a.from, b.from, a.to, b.to}.during(part.begin, part.end);
                if (!stays_aside(edge, link) && edge_passes(edge, link)) found[group].push_back(e);
              }
            }
          },
          4);
      for (const auto& some : found) crossed.insert(crossed.end(), some.begin(), some.end());
    }
  }
  cross_entries(s, crossed, changed, report);
}

}  // namespace tissue_sim
