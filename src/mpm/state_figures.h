// Figures that a state has, the same for all devices.
#pragma once

#include <cstdint>

#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// How much tissue stiffened as it deformed: for each material of each body the largest of
/// BlockState's, and after them the largest ||F||^2 of the body's points.
using Stiffening = std::vector<std::vector<float>>;

/// The same for all.
Stiffening even_stiffening(const MpmState& state, float stiffening);

/// The largest such `damping` of all materials, as they are deformed and however they are cut
/// [1/s].
double fastest_damping(const MpmState& state, const Stiffening& stiffening);

/// The substep that is stable however the tissue is cut, by the scene's CFL number [s].
float stable_substep(const MpmState& state, const Stiffening& stiffening);

/// Whether a bond bridge or a bit of debris may be ill-conditioned, as of
/// MpmState::worst_stiffening: mpm/tear/debris.h.
bool may_be_ill_conditioned(const MpmState& state);

/// Hash of nodes, bonds and pieces.
std::uint64_t checksum(const MpmState& state, const Pieces& pieces);

/// Sums over the nodes, in double.
Momentum momentum(const MpmState& state);

}  // namespace tissue_sim
