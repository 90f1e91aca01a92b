// Lists of neighbours: particles and triangles in a grid of cells as long as the kernel reaches.
#include <algorithm>
#include <cmath>

#include "fluid/fluid_state.h"

namespace tissue_sim {
namespace {

/// Particles sorted by the cells of a box.
class Cells {
 public:
  Cells(const FluidParticles& p, float edge) : edge_(edge) {
    float high[3];
    for (int a = 0; a < 3; ++a) {
      const auto [low, top] = std::minmax_element(p.x[a].begin(), p.x[a].end());
      low_[a] = p.size() > 0 ? *low : 0;
      high[a] = p.size() > 0 ? *top : 0;
    }
    // Drops that are far apart take larger cells, not more memory.
    const double most = 8.0 * p.size() + 4096;
    for (;; edge_ *= 1.5f) {
      double cells = 1;
      for (int a = 0; a < 3; ++a) {
        n_[a] = 1 + static_cast<int>((high[a] - low_[a]) / edge_);
        cells *= n_[a];
      }
      if (cells <= most) break;
    }
    begin_.assign(static_cast<std::size_t>(n_[0]) * n_[1] * n_[2] + 1, 0);
    std::vector<std::int32_t> cell(p.size());
    for (int i = 0; i < p.size(); ++i) {
      cell[i] = index(at(p.x[0][i], 0), at(p.x[1][i], 1), at(p.x[2][i], 2));
      ++begin_[cell[i] + 1];
    }
    for (std::size_t c = 1; c < begin_.size(); ++c) begin_[c] += begin_[c - 1];
    sorted_.resize(p.size());
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    for (int i = 0; i < p.size(); ++i) sorted_[next[cell[i]]++] = i;
    for (int a = 0; a < 3; ++a) {
      x_[a].resize(p.size());
      for (int k = 0; k < p.size(); ++k) x_[a][k] = p.x[a][sorted_[k]];
    }
  }

  /// Calls f(particle, squared distance) for all nearer than `reach` to the box from `low` to
  /// `high`.
  template <class F>
  void for_each_within(const float* low, const float* high, float reach, const F& f) const {
    constexpr std::int32_t kEach = 64;
    float distance2[kEach];
    int from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      if (high[a] + reach < low_[a] || low[a] - reach > low_[a] + n_[a] * edge_) return;
      from[a] = at(low[a] - reach, a);
      to[a] = at(high[a] + reach, a);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        const int row = index(0, y, z);
        const std::int32_t end = begin_[row + to[0] + 1];
        for (std::int32_t s = begin_[row + from[0]]; s < end; s += kEach) {
          const std::int32_t count = std::min(kEach, end - s);
          for (std::int32_t k = 0; k < count; ++k) {  // without branches: many at a time
            float d2 = 0;
            for (int a = 0; a < 3; ++a) {
              const float x = x_[a][s + k];
              const float under = low[a] - x, over = x - high[a];
              float d = under > over ? under : over;
              d = d > 0 ? d : 0;
              d2 += d * d;
            }
            distance2[k] = d2;
          }
          for (std::int32_t k = 0; k < count; ++k) {
            if (distance2[k] < reach * reach) f(sorted_[s + k], distance2[k]);
          }
        }
      }
    }
  }

  const std::vector<std::int32_t>& sorted() const { return sorted_; }

 private:
  int at(float x, int a) const {
    const float c = (x - low_[a]) / edge_;
    return c > 0 ? std::min(n_[a] - 1, static_cast<int>(c)) : 0;
  }
  int index(int x, int y, int z) const { return (z * n_[1] + y) * n_[0] + x; }

  float edge_, low_[3];
  int n_[3];
  std::vector<std::int32_t> begin_, sorted_;
  std::vector<float> x_[3];  ///< as sorted
};

/// Which triangles are near which particles: by triangle on all threads, then by particle, first
/// those that it may touch.
void list_walls(const Cells& cells, const FluidParticles& p, const std::vector<float>& corners,
                float reach, float near, Cpu& cpu, FluidLists& l) {
  constexpr int kEach = 256;
  struct Chunk {
    std::vector<std::int32_t> particle;  // by triangle
    std::vector<std::uint8_t> near;
  };
  const int triangles = static_cast<int>(corners.size() / 9);
  std::vector<Chunk> chunks((triangles + kEach - 1) / kEach);
  l.entry_begin.assign(triangles + 1, 0);
  cpu.for_each(static_cast<int>(chunks.size()), [&](int chunk) {
    Chunk& all = chunks[chunk];
    for (int t = chunk * kEach; t < std::min(triangles, (chunk + 1) * kEach); ++t) {
      const float* c = &corners[std::size_t{9} * t];
      float low[3], high[3];
      for (int a = 0; a < 3; ++a) {
        low[a] = std::min({c[a], c[3 + a], c[6 + a]});
        high[a] = std::max({c[a], c[3 + a], c[6 + a]});
      }
      const std::size_t before = all.particle.size();
      cells.for_each_within(low, high, reach, [&](std::int32_t i, float distance2) {
        all.particle.push_back(i);
        all.near.push_back(distance2 < near * near ? 1 : 0);
      });
      l.entry_begin[t + 1] = static_cast<std::int32_t>(all.particle.size() - before);
    }
  });
  l.wall_begin.assign(p.size() + 1, 0);
  l.wall_near.assign(p.size(), 0);
  for (const Chunk& all : chunks) {
    for (std::size_t k = 0; k < all.particle.size(); ++k) {
      ++l.wall_begin[all.particle[k] + 1];
      l.wall_near[all.particle[k]] += all.near[k];
    }
  }
  for (int i = 0; i < p.size(); ++i) {
    l.wall_begin[i + 1] += l.wall_begin[i];
    l.wall_near[i] += l.wall_begin[i];
  }
  std::vector<std::int32_t> next(l.wall_begin.begin(), l.wall_begin.end() - 1);
  std::vector<std::int32_t> next_far = l.wall_near;
  for (std::vector<std::int32_t>* field : {&l.wall, &l.entry, &l.entry_particle}) {
    field->resize(l.wall_begin.back());
  }
  l.met.clear();
  std::int32_t entry = 0;
  for (int t = 0; t < triangles; ++t) {
    const std::int32_t count = l.entry_begin[t + 1];
    if (count > 0) l.met.push_back(t);
    l.entry_begin[t + 1] = entry + count;
    const Chunk& all = chunks[t / kEach];
    const std::int32_t of_chunk = l.entry_begin[t / kEach * kEach];
    for (; entry < l.entry_begin[t + 1]; ++entry) {
      const std::int32_t i = all.particle[entry - of_chunk];
      const std::int32_t e = all.near[entry - of_chunk] != 0 ? next[i]++ : next_far[i]++;
      l.wall[e] = t;
      l.entry[entry] = e;
      l.entry_particle[entry] = i;
    }
  }
}

}  // namespace

void list_neighbours(FluidState& s, const std::vector<float>& corners, float skin) {
  const FluidParticles& p = s.particles;
  FluidLists& l = s.lists;
  const float reach = s.kernel.reach + skin;
  const Cells cells(p, 0.5f * reach);
  constexpr int kEach = 128;
  const int chunks = (p.size() + kEach - 1) / kEach;
  std::vector<std::vector<std::int32_t>> of_chunk(chunks);
  l.begin.assign(p.size() + 1, 0);
  s.cpu->for_each(chunks, [&](int chunk) {
    std::vector<std::int32_t>& all = of_chunk[chunk];
    all.reserve(kEach * 128);
    for (int i = chunk * kEach; i < std::min(p.size(), (chunk + 1) * kEach); ++i) {
      const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
      cells.for_each_within(x, x, reach, [&](std::int32_t j, float) {
        if (j != i) all.push_back(j);
      });
      l.begin[i + 1] = static_cast<std::int32_t>(all.size());
    }
  });
  std::int32_t before = 0;
  for (int chunk = 0; chunk < chunks; ++chunk) {
    const int end = std::min(p.size(), (chunk + 1) * kEach);
    for (int i = chunk * kEach; i < end; ++i) l.begin[i + 1] += before;
    before = l.begin[end];
  }
  l.other.resize(before);
  s.cpu->for_each(chunks, [&](int chunk) {
    std::copy(of_chunk[chunk].begin(), of_chunk[chunk].end(),
              l.other.begin() + l.begin[chunk * kEach]);
  });
  list_walls(cells, p, corners, reach, 0.5f * s.kernel.reach, *s.cpu, l);
  for (int a = 0; a < 3; ++a) l.x[a] = p.x[a];
  l.corners = corners;
  l.made = true;
}

void sort_particles(FluidState& s) {
  FluidParticles& p = s.particles;
  s.lists.made = false;
  if (p.size() == 0) return;
  const std::vector<std::int32_t> order = Cells(p, s.kernel.reach).sorted();
  const auto put = [&order](auto& field) {
    auto sorted = field;
    for (std::size_t i = 0; i < order.size(); ++i) sorted[i] = field[order[i]];
    field.swap(sorted);
  };
  for (int a = 0; a < 3; ++a) {
    put(p.x[a]);
    put(p.v[a]);
  }
  put(p.volume);
  put(p.pressure);
  put(p.dense);
  put(p.kind);
  put(p.id);
  put(p.fill);
}

}  // namespace tissue_sim
