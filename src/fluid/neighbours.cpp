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
  }

  /// Calls f(particle) for all in the cells that the box from `low` to `high` touches.
  template <class F>
  void for_each(const float* low, const float* high, const F& f) const {
    int from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      if (high[a] < low_[a] || low[a] > low_[a] + n_[a] * edge_) return;
      from[a] = at(low[a], a);
      to[a] = at(high[a], a);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        const int row = index(0, y, z);
        for (std::int32_t s = begin_[row + from[0]]; s < begin_[row + to[0] + 1]; ++s) {
          f(sorted_[s]);
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
};

/// Joins the lists of each particle into one.
void join(const std::vector<std::vector<std::int32_t>>& of, std::vector<std::int32_t>& begin,
          std::vector<std::int32_t>& all, Cpu& cpu) {
  begin.assign(of.size() + 1, 0);
  for (std::size_t i = 0; i < of.size(); ++i) {
    begin[i + 1] = begin[i] + static_cast<std::int32_t>(of[i].size());
  }
  all.resize(begin.back());
  cpu.for_each(
      static_cast<int>(of.size()),
      [&](int i) { std::copy(of[i].begin(), of[i].end(), all.begin() + begin[i]); }, 256);
}

float distance2(const float* corners, const float* x) {  // of the triangle's box
  float d2 = 0;
  for (int a = 0; a < 3; ++a) {
    const float low = std::min({corners[a], corners[3 + a], corners[6 + a]});
    const float high = std::max({corners[a], corners[3 + a], corners[6 + a]});
    const float d = std::max({low - x[a], x[a] - high, 0.0f});
    d2 += d * d;
  }
  return d2;
}

}  // namespace

void list_neighbours(FluidState& s, const std::vector<float>& corners, float skin) {
  const FluidParticles& p = s.particles;
  FluidLists& l = s.lists;
  const float reach = s.kernel.reach + skin;
  const Cells cells(p, reach);
  constexpr int kEach = 128;
  const int chunks = (p.size() + kEach - 1) / kEach;
  std::vector<std::vector<std::int32_t>> of_chunk(chunks);
  l.begin.assign(p.size() + 1, 0);
  s.cpu->for_each(chunks, [&](int chunk) {
    std::vector<std::int32_t>& all = of_chunk[chunk];
    all.reserve(kEach * 128);
    for (int i = chunk * kEach; i < std::min(p.size(), (chunk + 1) * kEach); ++i) {
      const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
      const float low[3] = {x[0] - reach, x[1] - reach, x[2] - reach};
      const float high[3] = {x[0] + reach, x[1] + reach, x[2] + reach};
      cells.for_each(low, high, [&](std::int32_t j) {
        const float d[3] = {p.x[0][j] - x[0], p.x[1][j] - x[1], p.x[2][j] - x[2]};
        if (j != i && dot3(d, d) < reach * reach) all.push_back(j);
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
  std::vector<std::vector<std::int32_t>> found(p.size());
  const int triangles = static_cast<int>(corners.size() / 9);
  for (int t = 0; t < triangles; ++t) {  // in turn: lists are by number
    const float* c = &corners[std::size_t{9} * t];
    float low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min({c[a], c[3 + a], c[6 + a]}) - reach;
      high[a] = std::max({c[a], c[3 + a], c[6 + a]}) + reach;
    }
    WallTriangle triangle;
    std::copy_n(c, 9, &triangle.corner[0][0]);
    triangle.finish();
    cells.for_each(low, high, [&](std::int32_t i) {
      const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
      if (triangle.height(x) < -2 * skin - s.spacing) return;  // it is far behind
      if (distance2(c, x) < reach * reach) found[i].push_back(t);
    });
  }
  join(found, l.wall_begin, l.wall, *s.cpu);
  l.entry_begin.assign(triangles + 1, 0);
  for (const std::int32_t t : l.wall) ++l.entry_begin[t + 1];
  l.met.clear();
  for (int t = 0; t < triangles; ++t) {
    if (l.entry_begin[t + 1] > 0) l.met.push_back(t);
  }
  for (int t = 0; t < triangles; ++t) l.entry_begin[t + 1] += l.entry_begin[t];
  l.entry.resize(l.wall.size());
  std::vector<std::int32_t> next(l.entry_begin.begin(), l.entry_begin.end() - 1);
  for (std::size_t e = 0; e < l.wall.size(); ++e) {
    l.entry[next[l.wall[e]]++] = static_cast<std::int32_t>(e);
  }
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
