#include "contact/face_contact.h"

#include "contact/face_places.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {
void push_faces(const MpmState& state, FaceContact& contact, float dt) {
  ContactPlaces places{state.nodes, contact};
  push_face(contact, dt, places);
}

void add_face_contacts(MpmState& state, int index, float dt, float* force) {
  FaceContacts& faces = state.faces;
  const Block& block = *state.blocks.all[index];
  for (std::int32_t i = faces.first_of_block[index]; i < faces.first_of_block[index + 1]; ++i) {
    FaceContact& c = faces.all[faces.of_block[i] / 2];
    const bool other = faces.of_block[i] % 2 == 1;
    if (!other && faces.block_of[c.other] == index) push_faces(state, c, dt);
    if (!c.touching) continue;
    const CellNodes& nodes = other ? c.other_nodes : c.nodes;
    const auto cell = static_cast<int>(nodes.lowest - block.node.data());
    const float sign = other ? -1.0f : 1.0f;
    spread(block, cell, other ? c.other_weights : c.weights,
           {sign * c.force[0], sign * c.force[1], sign * c.force[2]}, force);
  }
}

}  // namespace tissue_sim
