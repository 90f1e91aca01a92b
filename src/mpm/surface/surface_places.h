// Places on the true surface of a body: where tools and the ground touch it.
//
// Points lie inside their body, a quarter of a cell or so below its surface. Each bond that a point
// misses towards the outside, or that a cut broke, stands for a piece of the surface: the place on
// the body's own surface (shape or mesh) that is nearest to the middle of that side of the point's
// cube, or where the blade went. It moves with the nodes around by their weights at that very
// place, and what pushes there goes to them by the same weights.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/split/lattice_tissue.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

struct Block;

/// What of the surface one with this normal stands for before a bond that a point has not, whose
/// cube has this edge: of a plane, bonds along each axis are so many as its normal has of it, so
/// areas add up. 0 where it is so oblique that it stands for little.
inline float place_area(const float (&normal)[3], int bond, float edge) {
  const BondOffset o = bond_offset(bond);
  const float along = normal[0] * o.x + normal[1] * o.y + normal[2] * o.z;
  return along > 0.05f ? edge * edge * along : 0;
}

/// Of all bodies as they were while whole: by point, then bond. Throws what NearestSurface throws.
std::vector<OuterPlace> find_outer_places(const LatticeTissue& tissue);

/// Those of a point, by bond: its own of `whole_ones`, and where its bonds broke. Returns how many.
int places_of_point(const LatticeBody& body, const Points& points,
                    const std::vector<OuterPlace>& whole_ones, std::int32_t point,
                    OuterPlace (&places)[kBondCount]);

/// Those of a block, in the order of cells and keys; those of cuts among them.
std::vector<SurfacePlace> surface_places_of(const LatticeBody& body, const Points& points,
                                            const Block& block);

/// The same with one place for those of a cell that look the same way amid the surface, in their
/// middle: what a plane, as the ground is, needs of them, a quarter of the work where whole bodies
/// rest. It has the key and the point of the first.
std::vector<SurfacePlace> merged_places(const std::vector<SurfacePlace>& places,
                                        const Points& points);

}  // namespace tissue_sim
