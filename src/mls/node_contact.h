// Contact of tissue with tissue: faces of cuts, pieces and bodies among themselves, node by node.
#pragma once

#include <cstdint>
#include <vector>

#include "contact/contact_spring.h"
#include "mls/state.h"

namespace tissue_sim {

/// What a node touches anything with.
ContactSpring node_spring(const MlsState& state, std::int32_t i);

/// Finds the nodes that may touch before this is called again: of different pieces, or across a
/// cut, or far apart in their piece; `piece` is of each node. Two that are found keep the distance
/// below which they push: one edge, or less where they were nearer when they were found, so that a
/// fresh cut is free of stress.
void find_node_contacts(MlsState& state, const std::vector<std::int32_t>& piece, float dt);

/// Adds to force[3] on node i what those that touch it push: springs of both nodes in series and
/// dampers along the line between them, which only push. The same for both nodes but for the sign,
/// so momentum and angular momentum stay.
void add_node_contact(const MlsState& state, std::int32_t i, float* force);

}  // namespace tissue_sim
