#include "pbd/sections.h"

#include <algorithm>
#include <numeric>

#include "math/union_find.h"
#include "pbd/line_mender.h"
#include "pbd/pass_finder.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// A bend's vertices lie in three steps along edges that follow one another: lines between sections
/// and those through their middles are so far apart that none of them crosses two.
constexpr int kLeastSteps = 4;

/// How many edges each vertex is away from one at an end of the surface; a surface that is apart
/// from it goes on counting. Returns how many there are.
int count_steps(const State& s, std::vector<std::int32_t>& step) {
  const int n = s.vertices.size();
  std::vector<std::int32_t> begin(n + 1, 0), next(2 * static_cast<std::size_t>(s.edge_count));
  for (int c = 0; c < s.edge_count; ++c) {
    for (const std::int32_t v : s.links.vertices[c]) ++begin[v];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  for (int c = 0; c < s.edge_count; ++c) {
    const auto [a, b] = s.links.vertices[c];
    next[--begin[a]] = b;
    next[--begin[b]] = a;
  }
  std::vector<std::int32_t> queue;
  const auto walk = [&](std::int32_t from, int first) {
    queue.assign(1, from);
    step[from] = first;
    for (std::size_t k = 0; k < queue.size(); ++k) {
      const std::int32_t v = queue[k];
      for (int i = begin[v]; i < begin[v + 1]; ++i) {
        if (step[next[i]] >= 0) continue;
        step[next[i]] = step[v] + 1;
        queue.push_back(next[i]);
      }
    }
    return queue.back();
  };
  step.assign(n, -1);
  int count = 0;
  for (int v = 0; v < n; ++v) {
    if (step[v] >= 0) continue;
    std::int32_t end = v;
    for (int k = 0; k < 2; ++k) {  // the farthest from anywhere, and the farthest from that
      end = walk(end, count);
      for (const std::int32_t w : queue) step[w] = -1;
    }
    count = step[walk(end, count)] + 1;
  }
  return count;
}

/// The section of each step, and the number of sections.
int part_steps(const std::vector<std::int32_t>& step, int steps, int most,
               std::vector<std::int16_t>& section) {
  std::vector<int> vertices(steps, 0);
  for (const std::int32_t k : step) ++vertices[k];
  section.assign(steps, 0);
  const auto all = static_cast<double>(step.size());
  int now = 0, sum = 0, in_section = 0;
  for (int k = 0; k < steps; ++k) {
    section[k] = static_cast<std::int16_t>(now);
    sum += vertices[k];
    ++in_section;
    const int left = steps - 1 - k;
    if (now + 1 == most || in_section < kLeastSteps || left < kLeastSteps) continue;
    if (sum + 0.5 * vertices[k + 1] < all * (now + 1) / most) continue;
    ++now;
    in_section = 0;
  }
  return now + 1;
}

/// Of each step, which seam it belongs to: a line through the middle of each section between two.
std::vector<std::int16_t> find_seams(const std::vector<std::int16_t>& section, int sections) {
  std::vector<std::int16_t> seam(section.size());
  for (std::size_t k = 0; k < section.size();) {
    const auto begin = k,
               end = static_cast<std::size_t>(
                   std::upper_bound(section.begin(), section.end(), section[k]) - section.begin());
    for (; k < end; ++k) {
      const bool before = section[k] + 1 == sections || (section[k] > 0 && 2 * k < begin + end);
      seam[k] = static_cast<std::int16_t>(section[k] - (before ? 1 : 0));
    }
  }
  return seam;
}

/// Vertices that these links join, each lot with the worker that has the fewest. Such lots are
/// small beside the whole, for the ray back from where one ended ends near where that began. -1 for
/// those that none joins.
std::vector<std::int16_t> share_internal(const State& s, const std::vector<int>& links,
                                         int workers) {
  const int n = s.vertices.size();
  UnionFind joined(n);
  for (const int c : links) {
    joined.join(s.links.vertices[c][0], s.links.vertices[c][1]);
  }
  std::vector<int> size(n, 0), lots;
  for (int v = 0; v < n; ++v) ++size[joined.root(v)];
  for (int v = 0; v < n; ++v) {
    if (size[v] > 1) lots.push_back(v);
  }
  std::stable_sort(lots.begin(), lots.end(), [&](int a, int b) { return size[a] > size[b]; });
  std::vector<int> load(workers, 0);
  std::vector<std::int16_t> of_root(n, -1), owner(n);
  for (const int lot : lots) {
    const auto least = std::min_element(load.begin(), load.end());
    *least += size[lot];
    of_root[lot] = static_cast<std::int16_t>(least - load.begin());
  }
  for (int v = 0; v < n; ++v) owner[v] = of_root[joined.root(v)];
  return owner;
}

}  // namespace

Sections find_sections(const State& s, int most) {
  Sections none, found;
  const int n = s.vertices.size();
  std::vector<std::int32_t> step;
  std::vector<std::int16_t> section;
  const int steps = count_steps(s, step);
  found.count = part_steps(step, steps, most, section);
  if (found.count < 2) return none;
  const std::vector<std::int16_t> seam = find_seams(section, found.count);
  auto& [home, across, seams] = found.owner;
  for (int v = 0; v < n; ++v) {
    home.push_back(section[step[v]]);
    seams.push_back(seam[step[v]]);
  }
  LineMender(s, home, seams).run();
  LineMender(s, seams, home).run();
  const auto choice = [&](const auto& vertices) {
    Choice c = {{-1, -1, -1, -1}, {home[vertices[0]], seams[vertices[0]]}};
    std::copy(vertices.begin(), vertices.end(), c.vertices.begin());
    for (const std::int32_t v : vertices) {
      if (home[v] != c.worker[0]) c.worker[0] = -1;
    }
    for (const std::int32_t v : vertices) {
      if (seams[v] != c.worker[1]) c.worker[1] = -1;
    }
    return c;
  };
  std::vector<Choice> near, far, bends;
  std::vector<int> near_links, far_links;  // of edges all are near
  for (int c = 0; c < s.links.size(); ++c) {
    const Choice of = choice(s.links.vertices[c]);
    const bool is_near = of.worker[0] >= 0 || of.worker[1] >= 0;
    (is_near ? near_links : far_links).push_back(c);
    if (is_near) near.push_back(of);
  }
  across = share_internal(s, far_links, found.count);
  for (const int c : far_links) {
    const auto [a, b] = s.links.vertices[c];
    far.push_back({{a, b, -1, -1}, {across[a], -1}});
  }
  for (int v = 0; v < n; ++v) {
    if (across[v] < 0) across[v] = home[v];  // stays there
  }
  for (const auto& v : s.bends.vertices) bends.push_back(choice(v));
  std::vector<std::int16_t> near_pass, far_pass, bend_pass;
  int of_near[2], of_far[2], of_bends[2];
  if (!PassFinder(near, n, found.count).find(near_pass, of_near) ||
      !PassFinder(far, n, found.count).find(far_pass, of_far) ||
      !PassFinder(bends, n, found.count).find(bend_pass, of_bends)) {
    return none;
  }
  int* first = found.first;
  const int lengths[5] = {of_near[0], of_far[0], of_near[1], of_bends[1], of_bends[0]};
  std::partial_sum(lengths, lengths + 5, first + 1);
  const auto number = [](int pass, int at_home, int at_seam) {
    return static_cast<std::int16_t>(pass / 2 + (pass % 2 == 0 ? at_home : at_seam));
  };
  found.link_pass.resize(s.links.size());
  for (std::size_t k = 0; k < near.size(); ++k) {
    found.link_pass[near_links[k]] = number(near_pass[k], first[0], first[2]);
  }
  for (std::size_t k = 0; k < far.size(); ++k) {
    found.link_pass[far_links[k]] = number(far_pass[k], first[1], 0);
  }
  for (const int p : bend_pass) found.bend_pass.push_back(number(p, first[4], first[3]));
  return found;
}

}  // namespace pbd
}  // namespace tissue_sim
