// Threads: what hangs on by points one after the other, thinner than the lattice tells.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/mpm_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// A thread is a bond that is in no square of four bonds. It tears where it is stretched so far,
/// whatever its material: between halves that part it would be drawn out without end, and what
/// hangs on it would whirl about, too fast for any substep.
inline constexpr float kThreadStretch = 1.5f;
/// ... and its point has stiffened so much (see BlockState), for tissue may be stretched on
/// purpose.
inline constexpr float kThreadStiffening = 5;

/// After the points `changed` lost bonds: adds the ends of new threads to MpmState::threads.
void list_threads(MpmState& state, const std::vector<std::int32_t>& changed);

/// Whether a thread may be stretched that far, as of Block::modulus.
bool may_tear_threads(const MpmState& state);

/// Tears threads. Appends the points that lost a bond to `changed`, by number, and counts into
/// `report`.
void tear_threads(MpmState& state, std::vector<std::int32_t>& changed, CutReport& report);

}  // namespace tissue_sim
