#include "contact/face_contact.h"

#include "contact/face_places.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {
namespace {

/// Adds a force, spread by weights over the 27 nodes of a cell, to a block's forces.
void spread(const Block& block, int cell, const AxisWeights& weights, const float (&push)[3],
            float sign, float* force) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  const int component = block.node_count();
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      float* to = force + cell + z * block.plane + y * block.pitch;
      const float w = sign * wz[z] * wy[y];
      for (int c = 0; c < 3; ++c) {
        const float p = w * push[c];
        for (int x = 0; x < 3; ++x) to[c * component + x] += p * wx[x];
      }
    }
  }
}

}  // namespace

void push_faces(const MpmState& state, FaceContact& contact, float dt) {
  ContactPlaces places{state.nodes, contact};
  push_face(contact, dt, places);
}

void add_face_contacts(const MpmState& state, int index, float* force) {
  const FaceContacts& faces = state.faces;
  const Block& block = *state.blocks.all[index];
  for (std::int32_t i = faces.first_of_block[index]; i < faces.first_of_block[index + 1]; ++i) {
    const FaceContact& c = faces.all[faces.of_block[i] / 2];
    if (!c.touching) continue;
    const bool other = faces.of_block[i] % 2 == 1;
    const Facet& facet = facet_of(state, other ? c.other : c.facet);
    spread(block, facet.cell, other ? c.other_weights : c.weights, c.force, other ? -1.0f : 1.0f,
           force);
  }
}

}  // namespace tissue_sim
