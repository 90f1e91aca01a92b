// Facets: the surface of a body in reference space, cut faces included: one for each face on which
// points of a cell have lost, or never had, neighbours (mpm/blocks/known_facets.h).
#pragma once

#include <cstdint>

namespace tissue_sim {

/// Points of one cell and block whose bonds towards one side are gone.
struct Facet {
  std::int32_t point;      ///< lowest of its points
  std::int32_t cell;       ///< z * plane + y * pitch + x: its cell, and its stencil's lowest node
  std::uint8_t direction;  ///< of a bond that it misses: mpm/lattice/bonds.h
  float center[3];         ///< in cells, from the middle of the cell
  float normal[3];         ///< unit, outward, in reference space
  float extent[3];         ///< half its size along each axis [cells]; 0: none along it
  float area;              ///< [m^2]
};

// A place on the surface of a body: see mpm/surface/surface_places.h.

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
