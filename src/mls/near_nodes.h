// Nodes that may touch others before they are looked for again.
#pragma once

#include <cstdint>
#include <vector>

#include "mls/state.h"

namespace tissue_sim {

struct MlsNear {
  std::int32_t low, high;
};

/// Pairs of the nodes `outer` that are within reach after each has moved by its skin [m], and may
/// touch: those of different pieces, across a cut, or far apart in their piece; `piece` is of each
/// node. In an order that hangs on the nodes alone.
std::vector<MlsNear> find_near_nodes(const MlsState& state, const std::vector<std::int32_t>& piece,
                                     const std::vector<std::int32_t>& outer,
                                     const std::vector<float>& skin);

}  // namespace tissue_sim
