// Tissue and what touches it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cutting/resisting_edge.h"
#include "mpm/contact/block_contact.h"
#include "mpm/contact/face_contact.h"

namespace tissue_sim {

struct TouchingTissue : BlockTissue {
  std::vector<Collider> colliders;
  Contacts contacts;                         ///< with them
  ResistingEdges edges;                      ///< of blades
  FaceContacts faces;                        ///< of tissue with tissue
  std::vector<std::int32_t> inertial_index;  ///< per node, in ContactInertia; -1 for none
};

// Edges of blades in tissue that resists them (cutting/resisting_edge.h), on the lattice: as in
// cutting/edge_forces.h.
class EdgePushes;
void look_for_edges(TouchingTissue& state, const FrameInput& input, double begin);
std::vector<BladePath> held_paths(TouchingTissue& state, const FrameInput& input, double end);
/// For a part of a frame; null where no edge holds tissue.
std::unique_ptr<EdgePushes> edge_pushes(TouchingTissue& state);

}  // namespace tissue_sim
