// Faces of anchors where tools and the ground touch the tissue beside them.
#pragma once

#include <algorithm>

#include "mpm/anchors/anchor_faces.h"

namespace tissue_sim {

/// Share of what a face is off that a substep of `dt` mends: what rounding left, and what rows are
/// off where tissue tears, for they hold other nodes then, or with other weights. It is mended by a
/// velocity, which must not grow as substeps get shorter: at a tenth of 60 um in each of 1 us a few
/// light nodes had more energy than all tissue, and the watch on energy made substeps shorter
/// still.
inline float face_drift(float dt) {
  constexpr float kMost = 0.1f, kTime = 1e-3f;  // [s]
  return std::min(kMost, dt / kTime);
}

/// Whether a row's first node swings: points in the outer half of the face's cell alone see it,
/// with weight 1/32, so it has less than that of the mass of the node outside.
inline bool is_swing(const FaceRow& row) {
  constexpr float kLight = 1 / 32.0f;
  if (row.share[0] == 0 || row.share[2] == 0) return false;
  return row.weight[0] / row.share[0] < kLight * row.weight[2] / row.share[2];
}
/// Share of its velocity that such a node loses in a substep. Nothing but these points holds it:
/// with the energy that every motion of tissue has in the end it swings by many cells, the farther
/// the less of them lies outside the anchor, stretches them ninefold where others are twofold, and
/// they tear. At rest nothing changes; of the energy of what vibrates it takes less than a
/// thousandth a period.
inline constexpr float kSwingLoss = 0.02f;

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
