// What lets the stiff springs of contact keep the substeps of tissue.
//
// A spring k between a surface and a collider would swing faster than any substep. Beside it stands
// an added mass b = k dt^2 / 2: it resists, with b times it, the acceleration of the surface
// towards or away from the collider. With M + B for the mass of the nodes and K + K_c for the
// stiffness,
//   x (K + K_c) x / x (M + B) x <= max(x K x / x M x, x K_c x / x B x),
// so the two together swing no faster than tissue alone or sqrt(2) / dt. B is taken node by node,
// which is not less than the added masses' own matrix, and acts along the contact's normal alone.
// What is at rest or moves with the tool does not feel it; when contact begins the nodes lose what
// of their speed towards the collider the added mass takes up, and so when longer substeps make it
// larger: it never gives energy back.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/array.h"
#include "compute/host_device.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/lattice/nodes.h"
#include "tools/collider.h"

namespace tissue_sim {

/// A node with added masses. Matrices are xx yy zz xy yz zx.
struct InertialNode {
  std::int32_t node;
  std::int32_t uses;      ///< places that it belongs to
  bool changed;           ///< since `share` was worked out
  std::int32_t collider;  ///< the last of them
  float place[3];         ///< in reference space [m]
  float mass;             ///< [kg]
  float inertia[6];       ///< B [kg]
  float share[6];         ///< (m I + B)^-1 B: of an acceleration, which does not happen
  float before[3];        ///< velocity before the substep [m/s]
  float impulse[3];       ///< on the node in the substep [N s]
  float grown;            ///< share of B that longer substeps brought, not yet taken in
  TISSUE_SIM_FIELDS(node, uses, changed, collider, place, mass, inertia, share, before, impulse,
                    grown)
};

/// Contact that begins (`sign` 1), ends (-1) or whose normal turned (both).
struct InertiaChange {
  float sign;
  bool begins;        ///< not merely turned
  std::int32_t node;  ///< lowest of the cell, in the block's nodes
  std::int32_t collider;
  float place[3];  ///< in cells, from the middle of the cell
  float normal[3];
  float inertia;      ///< b [kg]
  float velocity[3];  ///< of the collider there [m/s]
};

struct ContactInertia {
  std::vector<InertialNode> nodes;
  float dt = 0;  ///< the substep that the added masses are for [s]
};

struct TouchingTissue;

/// Before a substep of dt: makes the added masses those for it, where they are not.
void fit_inertia(TouchingTissue& state, float dt);
/// Before the nodes move: takes in the changes of all blocks, in a fixed order, and notes how fast
/// the nodes are.
void change_inertia(TouchingTissue& state);
/// After they moved: takes away what of the acceleration does not happen.
void resist_acceleration(InertialNode& node, float keep, float dt, Nodes& nodes);
/// Adds the impulses of a substep of `kick` seconds to the loads of the colliders.
void add_inertial_loads(const TouchingTissue& state, float kick, std::vector<ColliderLoad>& loads);
/// Forgets nodes without places. After blocks were made anew `all`: they begin anew.
void tidy_inertia(TouchingTissue& state, bool all);
/// After a checkpoint was restored.
void index_inertia(TouchingTissue& state);

// Faces of anchors where tools and the ground touch the tissue beside them.

/// Takes that from the nodes that swing of group `i` of BlockTissue::anchors, before it is held.
void calm_swings(TouchingTissue& state, int i, float dt);
/// Whether a tool or the ground has added masses (mpm/contact/contact_inertia.h) at a node that
/// group `i` of BlockTissue::anchors holds.
bool is_beside_tools(const TouchingTissue& state, int i);
/// hold_group() there: the nodes are as heavy as they are with their added masses, and what these
/// bear of the impulse acts on the tool. Projected in the metric of the mass alone, a face and a
/// tool would undo one another's work, and light nodes at the rim of the face would swing.
void hold_beside_tools(TouchingTissue& state, int i, float dt, const RigidMotion* before,
                       const RigidMotion* after);

}  // namespace tissue_sim
