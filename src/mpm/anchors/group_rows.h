// How rows of nodes at anchors' faces (anchor_faces.h) that have nodes in common are held together.
#pragma once

#include "mpm/anchors/anchor_faces.h"

namespace tissue_sim {

/// Has a row read what has no weight of a node of its own, which no other group writes.
void read_own(FaceRow& row);

/// Puts rows with nodes in common side by side, in groups of at most kLargestGroup, and works out
/// how they are held.
void group_rows(const Nodes& nodes, AnchorFaces& faces);

}  // namespace tissue_sim
