// Tissue and what touches it.
#pragma once

#include <cstdint>
#include <vector>

#include "cutting/resisting_edge.h"
#include "mpm/contact/block_contact.h"
#include "mpm/contact/face_contact.h"

namespace tissue_sim {

struct TouchingTissue : BlockTissue {
  std::vector<Collider> colliders;
  Contacts contacts;                         ///< with them
  ResistingEdges edges;                      ///< of blades, on the CPU
  FaceContacts faces;                        ///< of tissue with tissue
  std::vector<std::int32_t> inertial_index;  ///< per node, in ContactInertia; -1 for none
};

// Edges of blades in tissue that resists them (cutting/resisting_edge.h), on the lattice of the
// CPU.

/// Before blades go on: which pieces hold tissue, and which will on the way from the share `begin`
/// of the frame.
void look_for_edges(TouchingTissue& state, const FrameInput& input, double begin);

/// Before a substep of dt seconds, with the colliders where they will be: pushes nodes, adds what
/// acts on the blades to `loads`. Returns the work of cutting [J].
double push_by_edges(TouchingTissue& state, float dt, std::vector<ColliderLoad>& loads);

/// What edges sweep where they hold on, as in cutting/edge_forces.h.
std::vector<BladePath> held_paths(TouchingTissue& state, const FrameInput& input, double end);

}  // namespace tissue_sim
