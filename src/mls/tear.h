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

}  // namespace tissue_sim
