// Where tissue ends beside a node, and which way: what faces of tissue touch one another with.
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// Whether the node stands for a face that may touch others. Of nodes that a cut passes beside
/// those do that lie within an edge of it, one layer: what is behind them is not touched.
inline bool touches(const MlsState& state, std::int32_t i) {
  return state.outer[i] != 0 && state.face[4 * i + 3] >= 0;
}

/// Makes MlsState::face of a node anew: beside a cut the plane that fits best the places where cuts
/// pass its pairs, else the body's true surface. Without a direction where those places lie all
/// around it, as in a sheet one node thick.
void remake_face(MlsState& state, std::int32_t node);

/// What the node's support tells of its face now.
MlsKnowsFace knows_face(const MlsState& state, std::int32_t node);

}  // namespace tissue_sim
