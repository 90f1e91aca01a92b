#include "pbd/sections.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "math/union_find.h"

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
    const auto begin = k, end = static_cast<std::size_t>(
        std::upper_bound(section.begin(), section.end(), section[k]) - section.begin());
    for (; k < end; ++k) {
      const bool before = section[k] + 1 == sections || (section[k] > 0 && 2 * k < begin + end);
      seam[k] = static_cast<std::int16_t>(section[k] - (before ? 1 : 0));
    }
  }
  return seam;
}

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

/// A constraint and where it may be projected: by a worker of phase 0, by one of phase 1, or
/// either.
struct Choice {
  std::array<std::int32_t, 4> vertices;  ///< the last ones -1 where there are fewer
  std::int16_t worker[2];                ///< -1: not in this phase
};

/// The passes of both phases in turn, bits of a word: pass p of phase k is 2 p + k.
constexpr int kMostPasses = 64;
/// More gave no fewer passes.
constexpr int kOrders = 10;
using Passes = std::uint64_t;
constexpr Passes kOfPhase[2] = {0x5555555555555555u, 0xaaaaaaaaaaaaaaaau};

/// Finds the passes of each: a vertex, half of whose constraints may be projected in the other
/// phase, needs half the passes. `count` becomes the number of passes of each phase. False where
/// kMostPasses do not suffice.
class PassFinder {
 public:
  PassFinder(const std::vector<Choice>& all, int vertices, int workers)
      : all_(all), vertices_(vertices), workers_(workers), allowed_(all.size(), 0) {
    for (std::size_t c = 0; c < all.size(); ++c) {
      for (int k = 0; k < 2; ++k) allowed_[c] |= all[c].worker[k] >= 0 ? kOfPhase[k] : 0;
    }
  }
  bool find(std::vector<std::int16_t>& pass, int (&count)[2]) {
    // First those that have no choice and whose vertices have most constraints; then those of one
    // pass together, as find_colours() does it.
    std::vector<int> degree(vertices_, 0), weight;
    for (const Choice& c : all_) each(c, [&](std::int32_t v) { ++degree[v]; });
    for (const Choice& c : all_) {
      int most = 0, sum = 0;
      each(c, [&](std::int32_t v) {
        most = std::max(most, degree[v]);
        sum += degree[v];
      });
      weight.push_back(100 * most + sum + (c.worker[0] >= 0 && c.worker[1] >= 0 ? 0 : 1000000));
    }
    std::vector<std::int32_t> order(all_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t a, std::int32_t b) { return weight[a] > weight[b]; });
    std::vector<std::int16_t> now(all_.size());
    int least = kMostPasses + 1;
    for (int round = 0; round < kOrders; ++round) {
      if (!first_fit(order, now)) return false;
      int used[2] = {0, 0}, size[kMostPasses] = {}, place[kMostPasses];
      for (const std::int16_t p : now) {
        used[p % 2] = std::max(used[p % 2], p / 2 + 1);
        ++size[p];
      }
      if (used[0] + used[1] < least) {
        least = used[0] + used[1];
        std::copy_n(used, 2, count);
        pass = now;
      }
      std::array<int, kMostPasses> rank;
      std::iota(rank.begin(), rank.end(), 0);
      std::stable_sort(rank.begin(), rank.end(),
                       [&](int a, int b) { return round % 3 == 2 ? size[a] > size[b] : a > b; });
      for (int k = 0; k < kMostPasses; ++k) place[rank[k]] = k;
      std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
        return place[now[a]] < place[now[b]];
      });
    }
    even_out(pass, count);
    return true;
  }

 private:
  template <class F>
  static void each(const Choice& c, const F& f) {
    for (const std::int32_t v : c.vertices) {
      if (v >= 0) f(v);
    }
  }
  Passes taken_by_neighbours(const Choice& c, const std::vector<Passes>& taken) const {
    Passes sum = 0;
    each(c, [&](std::int32_t v) { sum |= taken[v]; });
    return sum;
  }
  bool first_fit(const std::vector<std::int32_t>& order, std::vector<std::int16_t>& pass) const {
    std::vector<Passes> taken(vertices_, 0);
    for (const std::int32_t c : order) {
      const Passes free = allowed_[c] & ~taken_by_neighbours(all_[c], taken);
      if (free == 0) return false;
      pass[c] = static_cast<std::int16_t>(__builtin_ctzll(free));
      each(all_[c], [&](std::int32_t v) { taken[v] |= Passes{1} << pass[c]; });
    }
    return true;
  }
  /// Moves constraints to where their worker has fewer, so that a pass takes few rounds of threads.
  void even_out(std::vector<std::int16_t>& pass, const int (&count)[2]) const {
    std::vector<Passes> taken(vertices_, 0);
    std::vector<int> size(static_cast<std::size_t>(kMostPasses) * workers_, 0);
    const auto size_of = [&](std::size_t c, int p) -> int& {
      return size[static_cast<std::size_t>(p) * workers_ + all_[c].worker[p % 2]];
    };
    for (std::size_t c = 0; c < all_.size(); ++c) {
      each(all_[c], [&](std::int32_t v) { taken[v] |= Passes{1} << pass[c]; });
      ++size_of(c, pass[c]);
    }
    bool moved = true;
    for (int round = 0; round < kOrders && moved; ++round) {
      moved = false;
      for (std::size_t c = 0; c < all_.size(); ++c) {
        const Passes free = allowed_[c] & ~taken_by_neighbours(all_[c], taken);
        int to = pass[c], least = size_of(c, to) - 1;
        for (int p = 0; p < kMostPasses; ++p) {
          if ((free >> p & 1) == 0 || p / 2 >= count[p % 2] || size_of(c, p) >= least) continue;
          to = p;
          least = size_of(c, p);
        }
        if (to == pass[c]) continue;
        moved = true;
        --size_of(c, pass[c]);
        ++size_of(c, to);
        const Passes both = Passes{1} << pass[c] | Passes{1} << to;
        each(all_[c], [&](std::int32_t v) { taken[v] ^= both; });
        pass[c] = static_cast<std::int16_t>(to);
      }
    }
  }

  const std::vector<Choice>& all_;
  int vertices_, workers_;
  std::vector<Passes> allowed_;
};

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
