// The blocks of a region.
#pragma once

#include "mpm/blocks/blocks.h"

namespace tissue_sim {

inline constexpr int kGap = 2;  ///< cells: a new run costs about as much as so many

/// Makes the region's blocks, without facets: one for the sides of cuts that reach from the same
/// z-plane to the same, or with `uniform` one for each side and material.
void fill_region(BlockRegion& r, const LatticeTissue& tissue, bool uniform);

}  // namespace tissue_sim
