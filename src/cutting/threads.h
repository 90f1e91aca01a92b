// Threads: what hangs on by points one after the other, thinner than the lattice tells.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/mpm_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// A thread tears where it is stretched so far, whatever its material: a bond that is in no square
/// of four bonds. Between halves that part it would be drawn out without end, and what hangs on it
/// would whirl about, too fast for any substep.
inline constexpr float kThreadStretch = 1.5f;

/// Whether a block in which nodes are split has threads, and is deformed enough for them to tear as of Block::modulus.
bool may_have_stretched_threads(const MpmState& state, const Block& block);

/// Tears the threads of such blocks. Appends the points that lost a bond to `changed`, by number,
/// and counts into `report`.
void tear_threads(MpmState& state, std::vector<std::int32_t>& changed, CutReport& report);

}  // namespace tissue_sim
