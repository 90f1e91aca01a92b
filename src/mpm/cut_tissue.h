// Cuts: a sweep clears the bonds that it passes, then the nodes and blocks follow.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fragments/pieces.h"
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

// Pieces of lattice bodies: the components of the bonds.

/// Points begin .. end - 1: neighbours along x that hold together. They stand and fall together.
struct PointRun {
  std::int32_t begin, end;
};

/// All points by `bonds` of each, in order.
std::vector<PointRun> runs_along_x(const std::uint8_t* bonds, std::int32_t count);

/// The first run of each run's component, by the same bonds. Where two runs lie side by side the
/// first bond between them tells.
UnionFind linked_runs(const LatticeTissue& tissue, const std::uint8_t* bonds,
                      const std::vector<PointRun>& runs);

/// One piece for each body, and for each part of it that holds together by itself.
Pieces whole_pieces(const LatticeTissue& tissue);

/// Whether pieces may have come apart as the points `changed` lost bonds: false if near each of
/// them other bonds still hold it together with the neighbours that it lost.
bool may_have_parted(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed);

/// Labels the points anew after bonds broke (over runs of points along x). Returns the new ids.
std::vector<int> update_pieces(const LatticeTissue& tissue, Pieces& pieces);

}  // namespace tissue_sim
