#include "pbd/wound_loops.h"

#include <algorithm>

namespace tissue_sim {
namespace pbd {

std::vector<std::vector<std::int32_t>> open_loops(const State& s) {
  struct Half {
    std::uint64_t key;  // from, to
    std::int32_t triangle;
  };
  const auto key = [](std::int32_t from, std::int32_t to) {
    return static_cast<std::uint64_t>(from) << 32 | static_cast<std::uint32_t>(to);
  };
  std::vector<Half> halves;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const Triangle& c = s.triangles[t];
    if (s.stroke[c[0]] < 0 && s.stroke[c[1]] < 0 && s.stroke[c[2]] < 0) continue;  // no wound there
    for (int i = 0; i < 3; ++i) {
      halves.push_back(
          {key(s.triangles[t][i], s.triangles[t][(i + 1) % 3]), static_cast<std::int32_t>(t)});
    }
  }
  const auto before = [](const Half& p, const Half& q) {
    return p.key < q.key || (p.key == q.key && p.triangle < q.triangle);
  };
  std::sort(halves.begin(), halves.end(), before);
  const auto find = [&](std::int32_t from, std::int32_t to) {
    const Half wanted = {key(from, to), -1};
    const auto at = std::lower_bound(halves.begin(), halves.end(), wanted, before);
    return at != halves.end() && at->key == wanted.key ? static_cast<int>(at - halves.begin()) : -1;
  };
  const auto from_of = [&](int h) { return static_cast<std::int32_t>(halves[h].key >> 32); };
  const auto to_of = [&](int h) { return static_cast<std::int32_t>(halves[h].key); };
  const auto is_open = [&](int h) { return find(to_of(h), from_of(h)) < 0; };
  std::vector<bool> seen(halves.size(), false);
  std::vector<bool> left(halves.size(), false);  // in a loop that is no wound's
  std::vector<std::vector<std::int32_t>> loops;
  for (std::size_t start = 0; start < halves.size(); ++start) {
    if (seen[start] || s.stroke[from_of(static_cast<int>(start))] < 0) continue;
    if (!is_open(static_cast<int>(start))) continue;
    std::vector<std::int32_t> loop;
    std::vector<int> on_loop;
    bool is_wound = true;
    for (int h = static_cast<int>(start); h >= 0 && !seen[h];) {
      seen[h] = true;
      on_loop.push_back(h);
      loop.push_back(from_of(h));
      is_wound = is_wound && s.stroke[from_of(h)] >= 0;
      const std::int32_t at = to_of(h);
      int turns = 0;
      for (; h >= 0 && turns < 1000; ++turns) {  // around `at`, from triangle to triangle
        const Triangle& t = s.triangles[halves[h].triangle];
        const int i = t[0] == at ? 0 : t[1] == at ? 1 : 2;
        h = find(at, t[(i + 1) % 3]);
        const int beyond = find(t[(i + 1) % 3], at);
        if (beyond < 0) break;
        h = beyond;
      }
      if (turns == 1000) h = -1;
      is_wound = is_wound && h >= 0 && !left[h];
    }
    for (const int h : on_loop) left[h] = !is_wound;
    if (!is_wound || loop.size() < 3) continue;
    std::reverse(loop.begin(), loop.end());
    loops.push_back(loop);
  }
  return loops;
}

std::vector<LoopPart> simple_loops(const State& s, const std::vector<std::int32_t>& loop) {
  const double same = 0.1 * s.mean_edge;
  std::vector<LoopPart> simple;
  std::vector<std::int32_t> way;
  for (const std::int32_t v : loop) {
    const Vec3& x = s.vertices.reference[v];
    std::size_t from = 0;
    while (from < way.size() && (s.vertices.reference[way[from]] - x).norm() > same) ++from;
    if (from == way.size()) {
      way.push_back(v);
      continue;
    }
    if (way.size() - from >= 3) simple.push_back({{way.begin() + from, way.end()}, v});
    way.resize(from + 1);
  }
  if (way.size() >= 3) simple.push_back({way, -1});
  return simple;
}

}  // namespace pbd
}  // namespace tissue_sim
