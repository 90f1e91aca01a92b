// Edges of blades in tissue that resists them (cutting/resisting_edge.h), on nodes.
#pragma once

#include <memory>
#include <vector>

#include "cutting/edge_pushes.h"
#include "mls/state.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

// As in cutting/edge_forces.h.
void look_for_edges(MlsState& state, const FrameInput& input, double begin);
std::vector<BladePath> held_paths(MlsState& state, const FrameInput& input, double end);

/// For a part of a frame; null where no edge holds tissue.
std::unique_ptr<EdgePushes> edge_pushes(MlsState& state);

}  // namespace tissue_sim
