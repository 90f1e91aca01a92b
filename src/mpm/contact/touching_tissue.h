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

}  // namespace tissue_sim
