// Tearing: pairs that are stretched past what their material bears.
#pragma once

#include <cstdint>
#include <vector>

#include "mls/state.h"

namespace tissue_sim {

/// Whether any material tears.
bool can_tear(const MlsState& state);

/// Entries of the pairs that tear now: stretched past their limit, the mean of both nodes' (never
/// where one of them bears anything or is held), and the furthest past it of all pairs of both
/// nodes; and with each those that cross where it does, so that a crack parts what it passes. So it
/// goes on by a pair a node at a time, what it relieves holds, and nothing turns to dust where much
/// is past its limit at once. An entry may come twice.
std::vector<std::int32_t> find_tearing(MlsState& state);

/// Bits of few nodes among these pieces, which tore off just now, leave what was beside them no
/// faster than the energy stored at the limit could move them, (tear_stretch - 1) sqrt(E /
/// density): what else they have along the line between both goes to that. Whether any was slowed
/// down.
bool slow_torn_bits(MlsState& state, const std::vector<std::int32_t>& piece_of,
                    const std::vector<int>& pieces);

}  // namespace tissue_sim
