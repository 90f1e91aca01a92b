#include "mpm/contact/face_contact.h"

#include <algorithm>

#include "mpm/contact/face_places.h"
#include "mpm/contact/face_search.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {
namespace {

bool at_surface(const MpmState& state) { return state.scene.mpm.boundary == MpmBoundary::kSurface; }

}  // namespace

double fastest_block(const MpmState& state) {
  double fastest = 0;
  for (const BlockMotion& m : state.motion) fastest = std::max(fastest, m.speed);
  return fastest;
}

void search_if_faster(MpmState& state) {
  constexpr double kUnforeseen = 0.25;  // [cells]
  FaceContacts& faces = state.faces;
  const double until = faces.until_search;
  if (!(until <= kHorizon)) return;
  // All falls alike.
  const double falls = state.scene.gravity.norm() * (kHorizon - until);
  const double faster = fastest_block(state) - faces.fastest - falls;
  if (faster * until > kUnforeseen * state.scene.cell_size) faces.until_search = 0;
}

void push_faces(const MpmState& state, FaceContact& contact, float dt) {
  ContactPlaces places{state.nodes, contact, at_surface(state)};
  push_face(contact, dt, places);
}

void push_faces_within(MpmState& state, int index, float dt, const float* u) {
  FaceContacts& faces = state.faces;
  const Block& block = *state.blocks.all[index];
  for (std::int32_t i = faces.first_within[index]; i < faces.first_within[index + 1]; ++i) {
    FaceContact& contact = faces.all[faces.within[i]];
    PlacesInBlock places{{state.nodes, contact, at_surface(state)}, block, u};
    push_face(contact, dt, places);
  }
}

void add_face_contacts(const MpmState& state, int index, float* force) {
  const FaceContacts& faces = state.faces;
  const Block& block = *state.blocks.all[index];
  for (std::int32_t i = faces.first_of_block[index]; i < faces.first_of_block[index + 1]; ++i) {
    const FaceContact& c = faces.all[faces.of_block[i] / 2];
    const bool other = faces.of_block[i] % 2 == 1;
    if (!c.touching) continue;
    const CellNodes& nodes = other ? c.other_nodes : c.nodes;
    const auto cell = static_cast<int>(nodes.lowest - block.node.data());
    const float sign = other ? -1.0f : 1.0f;
    spread(block, cell, other ? c.other_weights : c.weights,
           {sign * c.force[0], sign * c.force[1], sign * c.force[2]}, force);
  }
}

}  // namespace tissue_sim
