// Faces of anchors where tools and the ground touch the tissue beside them.
#pragma once

#include "mpm/anchors/anchor_faces.h"

namespace tissue_sim {

struct MpmState;

/// Takes that from the nodes that swing of group `i` of MpmState::anchors, before it is held.
void calm_swings(MpmState& state, int i, float dt);
/// Whether a tool or the ground has inerters (mpm/contact/contact_inertia.h) at a node that group
/// `i` of MpmState::anchors holds.
bool is_beside_tools(const MpmState& state, int i);
/// hold_group() there: the nodes are as heavy as they are with their inerters, and what these bear
/// of the impulse acts on the tool. Projected in the metric of the mass alone, a face and a tool
/// would undo one another's work, and light nodes at the rim of the face would swing.
void hold_beside_tools(MpmState& state, int i, float dt, const RigidMotion* before,
                       const RigidMotion* after);

}  // namespace tissue_sim
