#include "contact/facet_pairs.h"

#include <algorithm>
#include <cmath>

#include "compute/simd.h"
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

/// The facets of a bucket, side by side.
class Members {
 public:
  void clear() { count_ = 0; }
  void add(const FacetMotion& f, float reach, std::int32_t entry) {
    const std::size_t end = count_ + 1 + kWidth;
    if (entry_.size() < end) {
      entry_.resize(2 * end);
      for (auto& value : value_) value.resize(2 * end);
    }
    for (int a = 0; a < 3; ++a) {
      value_[a][count_] = f.normal[a];
      value_[3 + a][count_] = f.x[a];
    }
    value_[6][count_] = reach;
    entry_[count_++] = entry;
    for (int a = 0; a < 3; ++a) std::fill_n(value_[a].begin() + count_, kWidth, 0.0f);
  }

  /// Calls f(entry, other) for all that face one another and whose boxes overlap.
  template <class F>
  void for_each_pair(const F& f) const {
    for (std::size_t i = 0; i < count_; ++i) {
      for (std::size_t j = i + 1; j < count_; j += kWidth) {
        const auto at = [this, j](int k) { return load<kWidth>(value_[k].data() + j); };
        // What has no normal, behind the end, faces nothing.
        Mask<kWidth> meets = ~bits<kWidth>(
            kFacing - (value_[0][i] * at(0) + value_[1][i] * at(1) + value_[2][i] * at(2)));
        const Vec<kWidth> far = value_[6][i] + at(6);
        for (int a = 3; a < 6; ++a) {
          const Mask<kWidth> apart = bits<kWidth>(value_[a][i] - at(a)) & 0x7fffffff;
          meets &= bits<kWidth>(reinterpret_cast<Vec<kWidth>>(apart) - far);
        }
        if (!any_negative<kWidth>(meets)) continue;
        for (int k = 0; k < kWidth; ++k) {
          if (meets[k] < 0) f(entry_[i], entry_[j + k]);
        }
      }
    }
  }

 private:
  static constexpr int kWidth = 4;
  std::size_t count_ = 0;
  std::vector<float> value_[7];  // normal, place, reach
  std::vector<std::int32_t> entry_;
};

/// Sorts pairs of so many facets.
std::vector<FacetPair> sorted(const std::vector<std::vector<FacetPair>>& chunks, int count) {
  std::vector<std::int32_t> end(count + 1, 0);
  for (const auto& chunk : chunks) {
    for (const FacetPair& pair : chunk) ++end[pair.first + 1];
  }
  for (int f = 0; f < count; ++f) end[f + 1] += end[f];
  std::vector<FacetPair> pairs(end.back());
  for (const auto& chunk : chunks) {
    for (const FacetPair& pair : chunk) pairs[end[pair.first]++] = pair;
  }
  for (int f = 0, begin = 0; f < count; begin = end[f++]) {
    std::sort(pairs.begin() + begin, pairs.begin() + end[f]);
  }
  return pairs;
}

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
  std::vector<std::vector<FacetPair>> chunks(kChunks);
  const auto visit_bucket = [&](std::uint32_t b, Members& members, std::vector<FacetPair>& pairs) {
    NormalBox normals;
    members.clear();
    for (std::int32_t i = first[b]; i < first[b + 1]; ++i) {
      const std::int32_t f = entries[i].facet;
      normals.take(facets[f].normal);
      members.add(facets[f], reach[f], i);
    }
    if (!normals.may_face()) return;
    members.for_each_pair([&](std::int32_t i, std::int32_t j) {
      const Entry &e = entries[i], &o = entries[j];
      if (e.x != o.x || e.y != o.y || e.z != o.z) return;
      // Of the grid cells that both boxes reach into, the lowest one says so.
      const GridBox &p = boxes[e.facet], &q = boxes[o.facet];
      if (e.x != std::max(p.min[0], q.min[0]) || e.y != std::max(p.min[1], q.min[1]) ||
          e.z != std::max(p.min[2], q.min[2])) {
        return;
      }
      pairs.emplace_back(std::min(e.facet, o.facet), std::max(e.facet, o.facet));
    });
  };
  cpu.for_each(kChunks, [&](int chunk) {
    const std::uint64_t buckets = std::uint64_t{mask} + 1;
    const auto begin = static_cast<std::uint32_t>(buckets * chunk / kChunks),
               end = static_cast<std::uint32_t>(buckets * (chunk + 1) / kChunks);
    Members members;
    for (std::uint32_t b = begin; b < end; ++b) visit_bucket(b, members, chunks[chunk]);
  });
  return sorted(chunks, count);
}

}  // namespace tissue_sim
