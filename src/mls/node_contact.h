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
/// the list was made wider, or nothing was looked for. How soon that may be is bounded by the
/// speed of all and of the `fastest` tool [m/s], so that most calls cost nothing. Those that may:
/// of different pieces, or across a cut, or far apart in their piece; `piece` is of each node.
/// Returns whether it looked.
bool update_node_contacts(MlsState& state, const std::vector<std::int32_t>& piece, float dt,
                          double fastest);

/// Lets the next update look for them whatever they moved: pieces or cuts changed.
inline void search_node_contacts(MlsState& state) {
  state.node_contacts.u_found.clear();
  state.node_contacts.until_look = 0;
}

/// With MlsContact::kFaces: numbers those that may touch, after begin, other and slip came from
/// elsewhere.
void number_node_contacts(MlsState& state);

/// Before a substep of `dt` [s], with MlsContact::kNodes on a CPU: MlsActive, anew where it is due.
void list_active(MlsState& state, float dt);

/// What the two of such a pair push one another with: springs of both nodes in series and dampers
/// along the line between them, which only push.
void push_active(MlsState& state, int pair);

/// Adds to force[4 kMlsChunk] on a chunk's nodes what those that touch them push. The same for both
/// nodes but for the sign, so momentum stays; angular momentum does, too, of faces with what
/// MlsFaceSubstep left in the stress.
void add_node_contact(const MlsState& state, int chunk, float* force);

}  // namespace tissue_sim
