// Contact of tissue with tissue: faces of cuts, pieces and bodies among themselves, node by node.
#pragma once

#include <cstdint>
#include <vector>

#include "contact/contact_spring.h"
#include "mls/state.h"

namespace tissue_sim {

/// What a node touches anything with.
inline ContactSpring node_spring(const MlsState& state, std::int32_t i) {
  return {state.contact_stiffness[i], state.contact_damping[i]};
}

/// Before each substep: finds the nodes that may touch anew where any of them moved by half of what
/// the list was made wider, or nothing was looked for. How soon that may be is bounded by their
/// speed, so that most calls cost nothing. Those that may: of different pieces, or across a cut, or
/// far apart in their piece; `piece` is of each node. Two that are found keep the distance below
/// which they push: one edge, or less where they were nearer when they were found, so that a fresh
/// cut is free of stress. Returns whether it looked.
bool update_node_contacts(MlsState& state, const std::vector<std::int32_t>& piece, float dt);

/// Lets the next update look for them whatever they moved: pieces or cuts changed.
inline void search_node_contacts(MlsState& state) {
  state.node_contacts.u_found.clear();
  state.node_contacts.until_look = 0;
}

/// Adds to force[3] on node i what those that touch it push: springs of both nodes in series and
/// dampers along the line between them, which only push. The same for both nodes but for the sign,
/// so momentum and angular momentum stay.
void add_node_contact(const MlsState& state, std::int32_t i, float* force);

}  // namespace tissue_sim
