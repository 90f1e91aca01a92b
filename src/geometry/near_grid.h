// Points near one another, found by spatial hashing: quick to build, for points that move.
#pragma once

#include <cmath>
#include <cstdint>
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
  }
  /// Calls f(index, squared distance) for each point at most `radius` [m] away, quickly up to an
  /// edge of a cell: in an order that hangs on the points alone.
  template <class F>
  void for_each_within(const Vec3& place, double radius, const F& f) const {
    const Cell low = cell_of(place - Vec3::Constant(radius)),
               high = cell_of(place + Vec3::Constant(radius));
    for (std::int32_t z = low.z; z <= high.z; ++z) {
      for (std::int32_t y = low.y; y <= high.y; ++y) {
        for (std::int32_t x = low.x; x <= high.x; ++x) {
          const Cell cell{x, y, z};
          const std::uint32_t bucket = bucket_of(cell);
          for (std::int32_t k = begin_[bucket]; k < begin_[bucket + 1]; ++k) {
            const Entry& e = entry_[k];
            if (e.cell.x != cell.x || e.cell.y != cell.y || e.cell.z != cell.z) continue;
            const double distance2 = (points_[e.point] - place).squaredNorm();
            if (distance2 <= radius * radius) f(e.point, distance2);
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
};

}  // namespace tissue_sim
