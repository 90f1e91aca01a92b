// Anchors hold tissue at their faces, not at the nodes that happen to lie in them.
#pragma once

#include "mls/nodes.h"
#include "mls/pairs.h"

namespace tissue_sim {

/// Moves held nodes that have free neighbours onto the face of their anchor between them, where a
/// node that moves is never nearer than a quarter of a spacing: one that would be is held and moved
/// to the face instead. Fills MlsNodes::free_volume: tissue within anchors bears no strain. After
/// make_pairs(), which takes the places as they were.
void hold_at_faces(const Scene& scene, double support_factor, MlsNodes& nodes, MlsPairs& pairs);

}  // namespace tissue_sim
