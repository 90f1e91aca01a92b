// Sheets: the points of a region, taken apart so that every node means one field.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/blocks/blocks.h"

namespace tissue_sim {

/// Points of one cell that see the same fields at all 27 nodes: those of a cell are one such share,
/// or several where a cut goes through it. Away from cuts, those of a run of whole cells are.
struct CellShare {
  std::int16_t x, y, z;   ///< cell in the region; of a run, the first
  std::int16_t cells;     ///< from there on along x: each one's points are two further on
  std::int16_t count;     ///< of a cell's points, whatever they are of
  std::int32_t point[8];  ///< by sub-position sx + 2 sy + 4 sz, -1 where it has none
};

/// One set of points for which each node of the region means one field.
struct Sheet {
  std::vector<CellShare> cells;
  std::vector<std::int32_t>
      node;  ///< of the region's nodes, -1 while no point needs it to be split
};

/// Takes the points of a region apart so that within a sheet no two see different fields of a node.
/// What the bonds hold together goes to one sheet where it fits, so that the sides of a cut are
/// sheets of their own and none has a gap where the other one is.
std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields);

}  // namespace tissue_sim
