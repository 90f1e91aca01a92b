// Sheets: the points of a region, taken apart so that every node means one field.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/blocks.h"

namespace tissue_sim {

/// A point in a region.
struct Placed {
  std::int32_t point;
  std::int16_t x, y, z;  // cell in the region
  std::int16_t s;        // sub-position: sx + 2 sy + 4 sz
};

/// One set of points for which each node of the region means one field.
struct Sheet {
  std::vector<Placed> points;
  std::vector<std::int32_t> node;  // of the region's nodes, -1 while no point needs it
};

/// Takes the points of a region apart so that within a sheet no two see different fields of a node;
/// each goes to the first sheet that it fits, side of a cut after side.
std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields);

}  // namespace tissue_sim
