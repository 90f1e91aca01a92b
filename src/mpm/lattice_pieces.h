// Pieces of lattice bodies: the components of the bonds.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "mpm/lattice_tissue.h"

namespace tissue_sim {

/// One piece for each body, and for each part of it that holds together by itself.
Pieces whole_pieces(const LatticeTissue& tissue);

/// Whether pieces may have come apart as the points `changed` lost bonds: false if near each of
/// them other bonds still hold it together with the neighbours that it lost.
bool may_have_parted(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed);

/// Labels the points anew after bonds broke (over runs of points along x). Returns the new ids.
std::vector<int> update_pieces(const LatticeTissue& tissue, Pieces& pieces);

}  // namespace tissue_sim
