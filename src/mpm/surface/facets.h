// Facets: the surface of a body in reference space, cut faces included: one for each face on which
// points of a cell have lost, or never had, neighbours.
#pragma once

#include <cstdint>
#include <vector>

namespace tissue_sim {

struct Block;
class KnownFacets;
struct LatticeBody;
struct Nodes;
struct Points;

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

/// The facets of a block; `known` are those of its region that need not be made anew. Where a blade
/// broke the bonds, place and normal are those of its sweep; else those of the plane that fits the
/// missing bonds of the columns around best, so that an oblique face is a plane, not stairs. Points
/// that an anchor holds have none beside its face, where nodes move that tell nothing of them.
std::vector<Facet> facets_of(const LatticeBody& body, const Points& points, const Nodes& nodes,
                             const Block& block, const KnownFacets& known);

}  // namespace tissue_sim
