// Figures that a state has, the same for all devices.
#pragma once

#include <cstdint>

#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// How much tissue stiffened as it deformed: for each material of each body the largest of
/// BlockState's.
using Stiffening = std::vector<std::vector<float>>;

/// The same for all.
Stiffening even_stiffening(const MpmState& state, float stiffening);

/// The largest stable substep times the CFL number [s].
float stable_substep(const MpmState& state, const Stiffening& stiffening);

/// Hash of nodes, bonds and pieces.
std::uint64_t checksum(const MpmState& state, const Pieces& pieces);

}  // namespace tissue_sim
