// What the fragment network is told of a point of the lattice: fragments/features.h.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/features.h"
#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// The features of a point. Cells are those of the reference lattice; F is the mean over the eight
/// places of a cell's points, as the point itself sees its own cell, and as the one at its place in
/// a neighbouring cell sees that.
void fragment_features(const MpmState& state, std::int32_t point, float* x);

/// Points that may soon be part of a fragment, by number: those whose strain is at least `share` of
/// their limit's and those that lost a bond, of tissue that may tear. None of loose pieces, and
/// none that is held.
std::vector<std::int32_t> fragment_candidates(MpmState& state, const Pieces& pieces, double share);

}  // namespace tissue_sim
