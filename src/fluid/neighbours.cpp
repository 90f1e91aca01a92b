// Lists of neighbours: particles and triangles in a grid of cells as long as the kernel reaches.
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "fluid/pair_sums.h"

namespace tissue_sim {
namespace {

/// A list that grows; behind what it has room for is room for sixteen more.
struct Found {
  std::vector<std::int32_t> all;
  int count = 0;
  std::int32_t* room_for(int size) {
    if (static_cast<int>(all.size()) < size + 16) all.resize(2 * size + 1024);
    return all.data();
  }
  void add(std::int32_t i) { room_for(count + 1)[count] = i, ++count; }
};

/// Places sorted by the cells of a box.
class Cells {
 public:
  /// limit(i): how near to i is near [m].
  template <class Limit>
  Cells(const Array<float> (&x)[3], float edge, Cpu& cpu, const Limit& limit) : edge_(edge) {
    constexpr int kAtOnce = 4096;
    const auto n = static_cast<int>(x[0].size());
    float high[3];
    for (int a = 0; a < 3; ++a) {
      const auto [low, top] = std::minmax_element(x[a].begin(), x[a].end());
      low_[a] = n > 0 ? *low : 0;
      high[a] = n > 0 ? *top : 0;
    }
    // Drops that are far apart take larger cells, not more memory.
    const double most = 8.0 * n + 4096;
    for (;; edge_ *= 1.5f) {
      double cells = 1;
      for (int a = 0; a < 3; ++a) {
        n_[a] = 1 + static_cast<int>((high[a] - low_[a]) / edge_);
        cells *= n_[a];
      }
      if (cells <= most) break;
    }
    begin_.assign(static_cast<std::size_t>(n_[0]) * n_[1] * n_[2] + 1, 0);
    std::vector<std::int32_t> cell(n);
    cpu.for_each(
        n, [&](int i) { cell[i] = index(at(x[0][i], 0), at(x[1][i], 1), at(x[2][i], 2)); },
        kAtOnce);
    for (const std::int32_t c : cell) ++begin_[c + 1];
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    sorted_.resize(n);
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (int i = 0; i < n; ++i) sorted_[next[cell[i]]++] = i;
    for (auto* field : {&x_[0], &x_[1], &x_[2], &limit2_}) field->resize(n);
    cpu.for_each(
        n,
        [&](int k) {
          for (int a = 0; a < 3; ++a) x_[a][k] = x[a][sorted_[k]];
          limit2_[k] = limit(sorted_[k]) * limit(sorted_[k]);
        },
        kAtOnce);
  }

  /// Those of a row of cells that are near one another, as sorted.
  struct Row {
    std::int32_t begin, end;
  };
  /// Adds to `found` those nearer to x than their limit, which is at most `reach`.
  void add_within(const float* x, float reach, InstructionSet set, Found& found) const {
    Row rows[64];  // of cells half as long as the reach
    int count = 0, most = 0, from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      if (x[a] + reach < low_[a] || x[a] - reach > low_[a] + n_[a] * edge_) return;
      from[a] = at(x[a] - reach, a);
      to[a] = at(x[a] + reach, a);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        const int row = index(0, y, z);
        const Row of{begin_[row + from[0]], begin_[row + to[0] + 1]};
        if (of.begin == of.end) continue;
        rows[count++] = of;
        most += of.end - of.begin;
      }
    }
    std::int32_t* out = found.room_for(found.count + most) + found.count;
#if defined(__x86_64__)
    if (set == InstructionSet::kAvx512) {
      found.count += add_rows_avx512(x, rows, count, out);
      return;
    }
#endif
    found.count += add_rows(x, rows, count, out);
  }

  const Array<std::int32_t>& sorted() const { return sorted_; }

 private:
  int at(float x, int a) const {
    const float c = (x - low_[a]) / edge_;
    return c > 0 ? std::min(n_[a] - 1, static_cast<int>(c)) : 0;
  }
  int index(int x, int y, int z) const { return (z * n_[1] + y) * n_[0] + x; }

  int add_rows(const float* x, const Row* rows, int count, std::int32_t* out) const {
    constexpr std::int32_t kMany = 64;
    int found = 0;
    for (const Row* row = rows; row < rows + count; ++row) {
      for (std::int32_t s = row->begin; s < row->end; s += kMany) {
        const std::int32_t n = std::min(kMany, row->end - s);
        float over[kMany];
        for (std::int32_t k = 0; k < n; ++k) {  // without branches: many at a time
          const float dx = x_[0][s + k] - x[0], dy = x_[1][s + k] - x[1], dz = x_[2][s + k] - x[2];
          over[k] = dx * dx + dy * dy + dz * dz - limit2_[s + k];
        }
        for (std::int32_t k = 0; k < n; ++k) {
          out[found] = sorted_[s + k];
          found += over[k] < 0 ? 1 : 0;
        }
      }
    }
    return found;
  }
#if defined(__x86_64__)
  /// The same bits, a sixth of the time.
  TISSUE_SIM_UNFUSED_AVX512 int add_rows_avx512(const float* x, const Row* rows, int count,
                                                std::int32_t* out) const {
    int found = 0;
    const __m512 x0 = _mm512_set1_ps(x[0]), x1 = _mm512_set1_ps(x[1]), x2 = _mm512_set1_ps(x[2]);
    for (const Row* row = rows; row < rows + count; ++row) {
      for (std::int32_t s = row->begin; s < row->end; s += 16) {
        const __m512 dx = _mm512_loadu_ps(&x_[0][s]) - x0, dy = _mm512_loadu_ps(&x_[1][s]) - x1,
                     dz = _mm512_loadu_ps(&x_[2][s]) - x2;
        const __m512 over = dx * dx + dy * dy + dz * dz - _mm512_loadu_ps(&limit2_[s]);
        const auto there = static_cast<__mmask16>((1u << std::min(16, row->end - s)) - 1);
        const __mmask16 near =
            _mm512_mask_cmp_ps_mask(there, over, _mm512_setzero_ps(), _CMP_LT_OQ);
        _mm512_storeu_si512(out + found,
                            _mm512_maskz_compress_epi32(near, _mm512_loadu_si512(&sorted_[s])));
        found += __builtin_popcount(near);
      }
    }
    return found;
  }
#endif

  float edge_, low_[3];
  int n_[3];
  std::vector<std::int32_t> begin_;
  Array<std::int32_t> sorted_;
  Array<float> x_[3], limit2_;  ///< as sorted
};

constexpr int kEach = 128;

/// Calls f(i, list) for each particle, which adds to the list; `begin` and `all` have the lists one
/// after the other.
template <class F>
void list_each(int n, Cpu& cpu, std::vector<std::int32_t>& begin, std::vector<std::int32_t>& all,
               const F& f) {
  const int chunks = (n + kEach - 1) / kEach;
  std::vector<Found> of_chunk(chunks);
  begin.assign(n + 1, 0);
  cpu.for_each(chunks, [&](int chunk) {
    Found& list = of_chunk[chunk];
    list.room_for(kEach * 64);
    for (int i = chunk * kEach; i < std::min(n, (chunk + 1) * kEach); ++i) {
      f(i, list);
      begin[i + 1] = list.count;
    }
  });
  std::int32_t before = 0;
  for (int chunk = 0; chunk < chunks; ++chunk) {
    const int end = std::min(n, (chunk + 1) * kEach);
    for (int i = chunk * kEach; i < end; ++i) begin[i + 1] += before;
    before = begin[end];
  }
  all.resize(before);
  cpu.for_each(chunks, [&](int chunk) {
    std::copy_n(of_chunk[chunk].all.begin(), of_chunk[chunk].count,
                all.begin() + begin[chunk * kEach]);
  });
}

/// Triangles about as large as one another, by their middles.
struct WallCells {
  std::vector<std::int32_t> triangle;  ///< of each place
  float radius = 0;                    ///< at most [m]
  std::unique_ptr<Cells> cells;

  WallCells(const std::vector<WallTriangle>& walls, std::vector<std::int32_t> those, float reach,
            Cpu& cpu)
      : triangle(std::move(those)) {
    Array<float> x[3];
    for (const std::int32_t t : triangle) {
      for (int a = 0; a < 3; ++a) x[a].push_back(walls[t].middle[a]);
      radius = std::max(radius, walls[t].radius);
    }
    cells = std::make_unique<Cells>(x, 0.5f * (reach + radius), cpu, [&](std::int32_t k) {
      return reach + walls[triangle[k]].radius;
    });
  }
};

/// Which triangles are near which particles, of each first those that it may touch.
void list_walls(FluidState& s, float reach, float near, float within) {
  const FluidParticles& p = s.particles;
  const std::vector<WallTriangle>& walls = s.now;
  FluidLists& l = s.lists;
  constexpr int kSizes = 8;  // a few large ones among them do not make all others be looked at
  std::vector<std::int32_t> of_size[kSizes];
  for (std::size_t t = 0; t < walls.size(); ++t) {
    if (!s.is_bit.empty() && s.is_bit[t] != 0) continue;
    int size = 0;
    for (float r = walls[t].radius; r > 0.3f * reach && size + 1 < kSizes; r *= 0.5f) ++size;
    of_size[size].push_back(static_cast<std::int32_t>(t));
  }
  std::vector<WallCells> cells;
  for (std::vector<std::int32_t>& those : of_size) {
    if (!those.empty()) cells.emplace_back(walls, std::move(those), reach, *s.cpu);
  }
  l.wall_soon.assign(p.size(), 0);
  l.wall_near.assign(p.size(), 0);
  list_each(p.size(), *s.cpu, l.wall_begin, l.wall, [&](int i, Found& list) {
    const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
    const int before = list.count;
    int soon = before, touches = before;
    for (const WallCells& of : cells) {
      int k = list.count;
      of.cells->add_within(x, reach + of.radius, s.instructions, list);
      for (std::int32_t* all = list.all.data(); k < list.count; ++k) {
        const std::int32_t t = of.triangle[all[k]];
        const float distance = walls[t].beside(x);
        all[k] = t;
        if (distance >= near) continue;
        std::swap(all[k], all[touches]);
        if (distance < within) std::swap(all[touches], all[soon++]);
        ++touches;
      }
    }
    l.wall_soon[i] = soon - before;
    l.wall_near[i] = touches - before;
  });
  for (int i = 0; i < p.size(); ++i) {
    l.wall_soon[i] += l.wall_begin[i];
    l.wall_near[i] += l.wall_begin[i];
  }
  std::vector<std::uint8_t> is_met(walls.size(), 0);
  for (const std::int32_t t : l.wall) is_met[t] = 1;
  l.met.clear();
  for (std::size_t t = 0; t < walls.size(); ++t) {
    if (is_met[t] != 0) l.met.push_back(static_cast<std::int32_t>(t));
  }
}

}  // namespace

void list_neighbours(FluidState& s, const std::vector<float>& corners, float skin) {
  const FluidParticles& p = s.particles;
  FluidLists& l = s.lists;
  const float reach = s.kernel.reach + skin;
  const Cells cells(p.x, 0.5f * reach, *s.cpu, [reach](std::int32_t) { return reach; });
  list_each(p.size(), *s.cpu, l.begin, l.other, [&](int i, Found& list) {
    const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
    cells.add_within(x, reach, s.instructions, list);
    while (list.count % kFluidLanes != 0) list.add(p.size());
  });
  s.now.resize(corners.size() / 9);
  s.cpu->for_each(
      static_cast<int>(s.now.size()), [&](int t) { s.now[t].place(&corners[std::size_t{9} * t]); },
      512);
  list_walls(s, reach, 0.5f * s.kernel.reach, fluid::kSoon * s.spacing);
  for (int a = 0; a < 3; ++a) l.x[a] = p.x[a];
  l.corners = corners;
  l.made = true;
}

void sort_particles(FluidState& s) {
  FluidParticles& p = s.particles;
  s.lists.made = false;
  if (p.size() == 0) return;
  const Array<std::int32_t> order =
      Cells(p.x, s.kernel.reach, *s.cpu, [](std::int32_t) { return 0.0f; }).sorted();
  FluidParticles& to = s.sorted;
  const auto put = [&order](const auto& from, auto& field) {
    field.resize(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) field[i] = from[order[i]];
  };
  s.cpu->for_each(6, [&](int k) {
    if (k < 3) {
      put(p.x[k], to.x[k]);
      put(p.v[k], to.v[k]);
    } else if (k == 3) {
      put(p.volume, to.volume);
      put(p.pressure, to.pressure);
    } else if (k == 4) {
      put(p.dense, to.dense);
      put(p.kind, to.kind);
    } else {
      put(p.id, to.id);
      put(p.fill, to.fill);
    }
  });
  std::swap(p, to);
}

}  // namespace tissue_sim
