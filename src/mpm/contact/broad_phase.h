// Facet pairs: which facets may meet within a while.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "compute/for_each.h"
#include "mpm/surface/facet_motion.h"

namespace tissue_sim {

using FacetPair = std::pair<std::int32_t, std::int32_t>;

/// Pairs (lower number first, sorted) of facets that face one another and whose swept boxes of half
/// size `reach` around their places overlap; none of those whose reach is 0, nor of two that are
/// debris. Facets of a block, from `first_of_block` on (one more than blocks), are looked at in
/// patches of those that follow one another within `patch` [m].
std::vector<FacetPair> facing_pairs(const std::vector<FacetMotion>& facets,
                                    const std::vector<float>& reach,
                                    const std::vector<std::uint8_t>& is_debris,
                                    const std::vector<std::int32_t>& first_of_block, float patch,
                                    Cpu& cpu);

}  // namespace tissue_sim
