// Which pairs of neighbours a blade's sweep crosses.
#pragma once

#include <cstdint>
#include <vector>

#include "mls/state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// Entries, one of each pair, of the uncrossed pairs that the path passes while nodes move from
/// displacements `u_begin` to `u_end` [4 n]; some may be there twice. Pairs as moving segments
/// (cutting/edge_passes.h), all of those that a look in single precision at both ends' places does
/// not leave on one side of what an edge sweeps. `places`: of each, where on the way from the
/// entry's node to the other it is crossed [0 to 1].
std::vector<std::int32_t> find_crossed(const MlsState& state, const BladePath& path,
                                       const float* u_begin, const float* u_end,
                                       std::vector<float>* places = nullptr);

}  // namespace tissue_sim
