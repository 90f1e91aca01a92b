// The blocks of a region.
#pragma once

#include "mpm/blocks.h"

namespace tissue_sim {

inline constexpr int kGap = 2;  ///< cells: a new run costs about as much as so many

/// Makes the region's blocks, each no larger than its points need, without facets; with
/// `one_material`, one for each of the materials of a mixed one.
void fill_region(BlockRegion& r, const std::vector<LatticeBody>& bodies, const Points& points,
                 const NodeFields& fields, bool one_material);

}  // namespace tissue_sim
