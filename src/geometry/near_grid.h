// Points near one another, found by spatial hashing: quick to build, for points that move.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Points by the cell of a grid that each lies in (Teschner, Heidelberger, Mueller, Pomeranets,
/// Gross 2003). Cells share the buckets of a table, so space has no bounds.
class NearGrid {
 public:
  /// `cell` is the edge of a cell [m], above 0; the points must outlive it.
  NearGrid(const std::vector<Vec3>& points, double cell) : points_(points), per_cell_(1 / cell) {
    std::size_t buckets = 16;
    while (buckets < 2 * points.size()) buckets *= 2;
    mask_ = buckets - 1;
    begin_.assign(buckets + 1, 0);
    std::vector<std::uint32_t> bucket(points.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
      bucket[p] = bucket_of(cell_of(points[p]));
      ++begin_[bucket[p] + 1];
    }
    for (std::size_t b = 0; b < buckets; ++b) begin_[b + 1] += begin_[b];
    std::vector<std::int32_t> next(begin_.begin(), begin_.end() - 1);
    entry_.resize(points.size());
    for (std::size_t p = 0; p < points.size(); ++p) {
      entry_[next[bucket[p]]++] = {cell_of(points[p]), static_cast<std::int32_t>(p)};
    }
    for (std::size_t b = 0; b < buckets; ++b) {
      const auto first = entry_.begin() + begin_[b], last = entry_.begin() + begin_[b + 1];
      if (last - first > 1) std::stable_sort(first, last);
    }
    for (std::size_t e = 0; e < entry_.size(); ++e) {
      if (e == 0 || entry_[e - 1] < entry_[e] || entry_[e] < entry_[e - 1]) {
        cell_begin_.push_back(static_cast<std::int32_t>(e));
      }
    }
    cell_begin_.push_back(static_cast<std::int32_t>(entry_.size()));
  }
  /// Cells that have points.
  int cells() const { return static_cast<int>(cell_begin_.size()) - 1; }
  /// Calls f(index) for each point of one of them.
  template <class F>
  void for_each_in(int cell, const F& f) const {
    for (std::int32_t e = cell_begin_[cell]; e < cell_begin_[cell + 1]; ++e) f(entry_[e].point);
  }
  /// Calls f(index) for all points that may be within `radius` [m] of one of that cell's, in an
  /// order that hangs on the points alone.
  template <class F>
  void for_each_around(int cell, double radius, const F& f) const {
    const auto far = static_cast<std::int32_t>(std::ceil(radius * per_cell_ * (1 - 1e-9)));
    const Cell at = entry_[cell_begin_[cell]].cell;
    for (std::int32_t z = at.z - far; z <= at.z + far; ++z) {
      for (std::int32_t y = at.y - far; y <= at.y + far; ++y) {
        for (std::int32_t x = at.x - far; x <= at.x + far; ++x) {
          const std::uint32_t bucket = bucket_of({x, y, z});
          for (std::int32_t k = begin_[bucket]; k < begin_[bucket + 1]; ++k) {
            const Entry& e = entry_[k];
            if (e.cell.x == x && e.cell.y == y && e.cell.z == z) f(e.point);
          }
        }
      }
    }
  }

 private:
  struct Cell {
    std::int32_t x, y, z;
  };
  struct Entry {
    Cell cell;
    std::int32_t point;
    bool operator<(const Entry& o) const {
      return std::tie(cell.x, cell.y, cell.z) < std::tie(o.cell.x, o.cell.y, o.cell.z);
    }
  };
  Cell cell_of(const Vec3& p) const {
    const auto along = [&](int a) {  // far away, and where it is no number, all share a cell
      const double c = std::floor(p[a] * per_cell_);
      return std::fabs(c) < 1e9 ? static_cast<std::int32_t>(c) : 1000000000;
    };
    return {along(0), along(1), along(2)};
  }
  std::uint32_t bucket_of(const Cell& c) const {
    const std::uint32_t h = static_cast<std::uint32_t>(c.x) * 73856093u ^
                            static_cast<std::uint32_t>(c.y) * 19349663u ^
                            static_cast<std::uint32_t>(c.z) * 83492791u;
    return static_cast<std::uint32_t>((h ^ h >> 15) & mask_);
  }

  const std::vector<Vec3>& points_;
  double per_cell_;
  std::size_t mask_ = 0;
  std::vector<std::int32_t> begin_;
  std::vector<Entry> entry_;
  std::vector<std::int32_t> cell_begin_;  ///< in entry_, of cells that have any; and the end
};

}  // namespace tissue_sim
