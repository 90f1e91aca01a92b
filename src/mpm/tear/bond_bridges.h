// Bond bridges: what hangs on by points one after the other, thinner than the lattice tells.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/mpm_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// A bridge is a bond that is in no square of four bonds. It tears where it is stretched so far,
/// and has stiffened so much (mpm/tear/debris.h), whatever its material: between halves that
/// part it would be drawn out without end, and what hangs on it would whirl about, too fast for any
/// substep. One that swings stiffens twentyfold within a few substeps: it is not to get near that.
inline constexpr double kThreadStretch = 1.5, kBridgeStiffening = 3.5;

/// Whether a point that has a bond in a square of four would have none without bond `k` of `point`.
bool leaves_thread(const LatticeBody& body, Points& points, std::int32_t point, int k);

/// After the points `changed` lost bonds: adds the ends of new bridges to MpmState::bridge_ends.
void list_bridges(MpmState& state, const std::vector<std::int32_t>& changed);

/// Tears bridges. Appends the points that lost a bond to `changed`, by number, and counts into
/// `report`.
void tear_bridges(MpmState& state, std::vector<std::int32_t>& changed, CutReport& report);

}  // namespace tissue_sim
