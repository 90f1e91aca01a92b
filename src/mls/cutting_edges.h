// Edges of blades in tissue that resists them (cutting/resisting_edge.h), on the nodes of the CPU.
#pragma once

#include <vector>

#include "mls/state.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

// As in cutting/edge_forces.h.
void look_for_edges(MlsState& state, const FrameInput& input, double begin);
double push_by_edges(MlsState& state, float dt, std::vector<ColliderLoad>& loads);
std::vector<BladePath> held_paths(MlsState& state, const FrameInput& input, double end);

}  // namespace tissue_sim
