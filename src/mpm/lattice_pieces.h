// Pieces of lattice bodies: the components of the bonds.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/split/node_box.h"

namespace tissue_sim {

/// One piece for each body, and for each part of it that holds together by itself.
Pieces whole_pieces(const std::vector<LatticeBody>& bodies, const Points& points);

/// Whether pieces may have come apart as the points `changed` lost bonds: false if near each of
/// them other bonds still hold it together with the neighbours that it lost.
bool may_have_parted(const std::vector<LatticeBody>& bodies, const Points& points,
                     const BondWindows& bonds, const std::vector<std::int32_t>& changed);

/// Labels the points anew after bonds broke (over runs of points along x). Returns the new ids.
std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               Pieces& pieces);

}  // namespace tissue_sim
