// Colours of constraints that may be projected in either of two phases (sections.h).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

namespace tissue_sim {
namespace pbd {

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

}  // namespace pbd
}  // namespace tissue_sim
