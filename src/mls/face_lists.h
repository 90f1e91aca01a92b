// Which faces may touch one another: those of cuts, pieces and bodies among themselves.
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
bool update_face_lists(MlsState& state, const std::vector<std::int32_t>& piece, float dt,
                       double fastest);

/// Lets the next update look for them whatever they moved: pieces or cuts changed.
inline void search_faces(MlsState& state) {
  state.face_contacts.u_found.clear();
  state.face_contacts.until_look = 0;
}

/// Numbers those that may touch, after begin, other and slip came from
/// elsewhere.
void number_faces(MlsState& state);

/// Adds to force[4 kMlsChunk] on a chunk's nodes what those that touch them push. The same for both
/// nodes but for the sign, so momentum stays; angular momentum does, too, with what MlsFaceSubstep
/// left in the stress.
void add_face_contact(const MlsState& state, int chunk, float* force);

}  // namespace tissue_sim
