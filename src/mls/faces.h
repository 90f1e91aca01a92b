// Where tissue ends beside a node, and which way: what faces of tissue touch one another with.
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// Whether tissue touches tissue so; else nodes push one another (mls/node_contact.h).
inline bool touches_by_faces(const MlsState& state) {
  return state.scene.mls.contact == MlsContact::kFaces;
}

/// Makes MlsState::face of a node anew: beside a cut the plane that fits best the places where cuts
/// pass its pairs, else the body's true surface. Without a direction where those places lie all
/// around it, as in a sheet one node thick.
void remake_face(MlsState& state, std::int32_t node);

/// What the node's support tells of its face now.
MlsKnowsFace knows_face(const MlsState& state, std::int32_t node);

}  // namespace tissue_sim
