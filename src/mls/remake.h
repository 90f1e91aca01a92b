// What hangs on the weights of a node's pairs: moments, penalty and springs.
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// The two steps of remake() (mls/state.h). First moments, penalty and what bears strain: writes
/// what is the node's alone, so that nodes may be made side by side.
void remake_support(MlsState& state, std::int32_t node);
/// Then the springs of those whose supports span no space.
void remake_springs(MlsState& state, const std::vector<std::int32_t>& nodes);

}  // namespace tissue_sim
