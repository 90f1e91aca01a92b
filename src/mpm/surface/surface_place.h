// A place on the surface of a body: see mpm/surface/surface_places.h.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// In a block.
struct SurfacePlace {
  std::int32_t cell;  ///< lane of its cell's first point
  std::int32_t node;  ///< lowest of that cell, in the block's nodes
  std::int32_t point;
  std::uint8_t points;  ///< bit s: stands for the surface before the one at sub-position s
  std::uint8_t
      key;          ///< 8 times 1 plus the point's place in the cell (x + 2 y + 4 z), plus the bond
  float place[3];   ///< in cells, from the middle of the cell
  float normal[3];  ///< unit, outward, in reference space
  float area;       ///< [m^2]
};

}  // namespace tissue_sim
