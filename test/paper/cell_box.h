// A box of grid cells around points: what fragments are found by where no bonds are known.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/for_each.h"

namespace tissue_sim {

/// Where points are; x[2] is null for points in a plane.
struct PointPlaces {
  const float* x[3] = {};  ///< [count] each [m]
  std::int32_t count = 0;
};

/// Cells of edge `cell_size` from `lowest` on.
struct CellBox {
  float lowest[3] = {};  ///< [m]
  float cell_size = 1;   ///< [m]
  int n[3] = {1, 1, 1};  ///< cells along each axis, at most kMostCells
};
inline constexpr int kMostCells = 1 << 20;

/// The cells that hold all points, whole cells from the grid through the origin. Throws
/// std::invalid_argument for no points, a cell size that is not above 0, a place that is not
/// finite and points further apart than kMostCells.
CellBox cell_box(const PointPlaces& places, double cell_size);

/// Where a cell is in memory: first + x + row * y + plane * z.
struct CellOrder {
  std::int32_t first, row, plane;
};

/// The cells of the points begin .. end - 1, to `cell` from its begin on. Throws
/// std::invalid_argument where one is in none of the box.
void find_cells(const PointPlaces& places, const CellBox& box, const CellOrder& order,
                std::int32_t begin, std::int32_t end, std::int32_t* cell);

/// The same for all points, spread over threads, and sets `held` to 1 where a cell holds points.
void mark_cells(const PointPlaces& places, const CellBox& box, const CellOrder& order, Cpu& cpu,
                std::vector<std::int32_t>& cell, std::vector<std::uint8_t>& held);

}  // namespace tissue_sim
