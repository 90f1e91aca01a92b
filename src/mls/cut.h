// Cuts: which pairs a blade's sweep crosses, and what that leaves of their weights.
#pragma once

#include <cstdint>
#include <vector>

#include "mls/state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// Crosses the pairs that the path passes while nodes move from displacements `u_begin` to `u_end`
/// [4 n], for ever, and makes weights, moments and springs around them anew. Counts in the report.
/// Adds the nodes that lost a pair to `changed`, by number.
///
/// Of a crossed pair is left twice the share of its common neighbours to which both of its nodes
/// still have an uncrossed pair, at most all of it: from 1 where a cut just reaches it to exactly 0
/// one spacing behind the rim, where nothing leads around it. That hangs on the set of crossed
/// pairs alone: however a cut was made, in one stroke or in many, slow or fast, it comes to the
/// same; it only falls, and between parts without an uncrossed pair it is 0.
void cross_pairs(MlsState& state, const BladePath& path, const float* u_begin, const float* u_end,
                 std::vector<std::int32_t>& changed, CutReport& report);

/// What cross_pairs() does in two steps. First the pairs, given by one of their entries each, are
/// marked as crossed, at these places (find_crossed(); in the middle where there are none); returns
/// the nodes that lost one, by number.
std::vector<std::int32_t> mark_crossed(MlsState& state, const std::vector<std::int32_t>& entries,
                                       const std::vector<float>& places, CutReport& report);
/// Then weights, moments and springs around these are made anew; returns the nodes of which they
/// are. What tells pieces apart it neither reads nor changes.
std::vector<std::int32_t> weaken(MlsState& state, const std::vector<std::int32_t>& touched);

/// Both steps, for cross_pairs() and tests.
void cross_entries(MlsState& state, const std::vector<std::int32_t>& entries,
                   const std::vector<float>& places, std::vector<std::int32_t>& changed,
                   CutReport& report);

}  // namespace tissue_sim
