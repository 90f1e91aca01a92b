#include "contact/facet_pairs.h"

#include <algorithm>
#include <cmath>

#include "contact/face_search.h"

namespace tissue_sim {
namespace {

struct GridBox {  // empty for facets without reach
  int min[3], max[3];
};

/// std::floor() would be a call, for the oldest processors lack the instruction. What is farther
/// than an int goes is all in one place.
int floor_of(float x) {
  constexpr float kFarthest = 1e9f;
  const int toward_zero = static_cast<int>(std::min(std::max(x, -kFarthest), kFarthest));
  return toward_zero - (x < static_cast<float>(toward_zero) ? 1 : 0);
}

/// A box around some normals.
struct NormalBox {
  float min[3] = {1, 1, 1}, max[3] = {-1, -1, -1};

  void take(const float (&n)[3]) {
    for (int a = 0; a < 3; ++a) {
      min[a] = std::min(min[a], n[a]);
      max[a] = std::max(max[a], n[a]);
    }
  }
  /// Whether two of them may face each other: on a smooth face none do.
  bool may_face() const {
    float dot = 0;  // at least
    for (int a = 0; a < 3; ++a) {
      dot += std::min({min[a] * max[a], min[a] * min[a], max[a] * max[a]});
    }
    return !(dot > kFacing);
  }
};

}  // namespace

std::vector<FacetPair> facing_pairs(const std::vector<FacetMotion>& facets,
                                    const std::vector<float>& reach, float grid, Cpu& cpu) {
  const auto count = static_cast<std::int32_t>(facets.size());
  const float per_grid = 1 / grid;
  std::vector<GridBox> boxes(count);
  std::size_t entry_count = 0;
  for (std::int32_t f = 0; f < count; ++f) {
    std::size_t cells = reach[f] > 0 ? 1 : 0;
    for (int a = 0; a < 3; ++a) {
      boxes[f].min[a] = floor_of((facets[f].x[a] - reach[f]) * per_grid);
      boxes[f].max[a] = floor_of((facets[f].x[a] + reach[f]) * per_grid);
      cells *= boxes[f].max[a] - boxes[f].min[a] + 1;
    }
    entry_count += cells;
    if (cells == 0) boxes[f].max[2] = boxes[f].min[2] - 1;
  }
  // Facets by bucket of a hash table of grid cells, counted first.
  struct Entry {
    int x, y, z;
    std::int32_t facet;
  };
  std::uint32_t mask = 1;
  while (mask < 2 * entry_count) mask *= 2;
  --mask;
  const auto bucket = [mask](int x, int y, int z) {
    const std::uint32_t h = static_cast<std::uint32_t>(x) * 73856093u ^
                            static_cast<std::uint32_t>(y) * 19349663u ^
                            static_cast<std::uint32_t>(z) * 83492791u;
    return (h ^ h >> 15) & mask;
  };
  const auto for_each_cell = [&boxes](std::int32_t f, const auto& visit) {
    for (int z = boxes[f].min[2]; z <= boxes[f].max[2]; ++z) {
      for (int y = boxes[f].min[1]; y <= boxes[f].max[1]; ++y) {
        for (int x = boxes[f].min[0]; x <= boxes[f].max[0]; ++x) visit(x, y, z);
      }
    }
  };
  std::vector<std::int32_t> first(mask + 2, 0);
  std::vector<Entry> entries(entry_count);
  for (std::int32_t f = 0; f < count; ++f) {
    for_each_cell(f, [&](int x, int y, int z) { ++first[bucket(x, y, z) + 1]; });
  }
  for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  std::vector<std::int32_t> next(first.begin(), first.end() - 1);
  for (std::int32_t f = 0; f < count; ++f) {
    for_each_cell(f, [&](int x, int y, int z) { entries[next[bucket(x, y, z)]++] = {x, y, z, f}; });
  }
  // Chunks of buckets side by side; sorted, the pairs come in the same order for any number.
  constexpr int kChunks = 64;
  struct Member {  // of a bucket
    float normal[3], x[3], reach;
    const Entry* entry;
  };
  struct Chunk {
    std::vector<Member> members;  // of the bucket at hand
    std::vector<FacetPair> pairs;
  };
  std::vector<Chunk> chunks(kChunks);
  const auto visit_bucket = [&](std::uint32_t b, Chunk& chunk) {
    NormalBox normals;
    chunk.members.clear();
    for (std::int32_t i = first[b]; i < first[b + 1]; ++i) {
      const FacetMotion& f = facets[entries[i].facet];
      normals.take(f.normal);
      chunk.members.push_back({{f.normal[0], f.normal[1], f.normal[2]},
                               {f.x[0], f.x[1], f.x[2]},
                               reach[entries[i].facet],
                               &entries[i]});
    }
    if (!normals.may_face()) return;
    const Member* end = chunk.members.data() + chunk.members.size();
    for (const Member* f = chunk.members.data(); f < end; ++f) {
      for (const Member* g = f + 1; g < end; ++g) {
        if (f->normal[0] * g->normal[0] + f->normal[1] * g->normal[1] +
                f->normal[2] * g->normal[2] >
            kFacing) {
          continue;
        }
        const float far = f->reach + g->reach;
        if (!(std::fabs(f->x[0] - g->x[0]) < far && std::fabs(f->x[1] - g->x[1]) < far &&
              std::fabs(f->x[2] - g->x[2]) < far)) {
          continue;
        }
        const Entry &e = *f->entry, &o = *g->entry;
        if (e.x != o.x || e.y != o.y || e.z != o.z) continue;
        // Of the grid cells that both boxes reach into, the lowest one says so.
        const GridBox &p = boxes[e.facet], &q = boxes[o.facet];
        if (e.x != std::max(p.min[0], q.min[0]) || e.y != std::max(p.min[1], q.min[1]) ||
            e.z != std::max(p.min[2], q.min[2])) {
          continue;
        }
        chunk.pairs.emplace_back(std::min(e.facet, o.facet), std::max(e.facet, o.facet));
      }
    }
  };
  cpu.for_each(kChunks, [&](int chunk) {
    const std::uint64_t buckets = std::uint64_t{mask} + 1;
    const auto begin = static_cast<std::uint32_t>(buckets * chunk / kChunks),
               end = static_cast<std::uint32_t>(buckets * (chunk + 1) / kChunks);
    for (std::uint32_t b = begin; b < end; ++b) visit_bucket(b, chunks[chunk]);
  });
  std::vector<FacetPair> pairs;
  for (const Chunk& c : chunks) pairs.insert(pairs.end(), c.pairs.begin(), c.pairs.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace tissue_sim
