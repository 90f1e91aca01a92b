// Figures that a state has, the same for all devices.
#pragma once

#include <cstdint>

#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// The largest stable substep times the CFL number [s]. `stiffening` is the largest of
/// BlockState's.
float stable_substep(const MpmState& state, float stiffening);

/// Hash of nodes, bonds and pieces.
std::uint64_t checksum(const MpmState& state, const Pieces& pieces);

}  // namespace tissue_sim
