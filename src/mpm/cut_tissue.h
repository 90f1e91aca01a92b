// Cuts: a sweep clears the bonds that it passes, then the nodes and blocks follow.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "mpm/mpm_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// Clears the bonds that a path passes while the tissue moves from the displacements `u_begin` to
/// `u_end` (the same array for a path through tissue at rest) and its blocks from `before` to
/// MpmState::motion. Appends the points that lost a bond to `changed` and counts into `report`; to
/// `touched` those at the rim of a cut of whose bonds more was passed (mpm/split/front.h).
void sweep_bonds(MpmState& state, const BladePath& path, const Array<float>* u_begin,
                 const Array<float>* u_end, const std::vector<BlockMotion>& before,
                 std::vector<std::int32_t>& changed, std::vector<std::int32_t>& touched,
                 CutReport& report);

/// A sweep looks at bonds of points within this many cells, so that a bond is seen as long as it is
/// not stretched to three times its length.
inline constexpr double kSweepReach = 1.5;

/// Clears bonds that are still there, each named once in one of some lists. Appends and counts as
/// sweep_bonds().
void break_bonds(LatticeTissue& tissue, const std::vector<std::vector<BrokenBond>>& broken,
                 std::vector<std::int32_t>& changed, CutReport& report);

/// Breaks the bonds that never were (Points::gaps): tissue is whole without them. Returns the
/// points that had them, for take_apart().
std::vector<std::int32_t> break_gaps(LatticeTissue& tissue);

/// What take_apart() did.
struct Apart {
  std::vector<std::int32_t> softened;  ///< points that became soft: mpm/tear/debris.h
  bool new_blocks = false;
};

/// Splits nodes and makes blocks anew after the points `changed` lost bonds. `meanwhile` is called
/// when nodes are split: it may not write what blocks are made of.
Apart take_apart(
    MpmState& state, const std::vector<std::int32_t>& changed,
    const std::function<void()>& meanwhile = [] {});

}  // namespace tissue_sim
