#include "mpm/contact/face_contact.h"

#include <algorithm>

#include "mpm/contact/face_places.h"
#include "mpm/contact/face_search.h"
#include "mpm/contact/touching_tissue.h"

namespace tissue_sim {

double fastest_block(const TouchingTissue& state) {
  double fastest = 0;
  for (const BlockMotion& m : state.motion) fastest = std::max(fastest, m.speed);
  return fastest;
}

void search_if_faster(TouchingTissue& state) {
  constexpr double kMissed = 0.25;  // [cells]
  FaceContacts& faces = state.faces;
  const double until = faces.until_search;
  if (!(until <= kHorizon)) return;
  // All falls alike.
  const double falls = state.scene.gravity.norm() * (kHorizon - until);
  const double faster = fastest_block(state) - faces.fastest - falls;
  if (faster * until > kMissed * state.scene.cell_size) faces.until_search = 0;
}

void push_faces(const TouchingTissue& state, FaceContact& contact, float dt) {
  ContactPlaces places{state.nodes, contact};
  push_face(contact, dt, places);
}

void push_faces_within(TouchingTissue& state, int index, float dt, const float* u) {
  FaceContacts& faces = state.faces;
  const Block& block = *state.blocks.all[index];
  for (std::int32_t i = faces.first_within[index]; i < faces.first_within[index + 1]; ++i) {
    FaceContact& contact = faces.all[faces.within[i]];
    PlacesInBlock places{{state.nodes, contact}, block, u};
    push_face(contact, dt, places);
  }
}

void add_face_contacts(const TouchingTissue& state, int index, float* force) {
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

void index_active(FaceContacts& faces) {
  faces.between.clear();
  faces.first_of_block.assign(faces.first_facet.size(), 0);
  faces.first_within = faces.first_of_block;
  for (const std::int32_t i : faces.active) {
    const FaceContact& c = faces.all[i];
    const std::int32_t own = faces.block_of[c.facet], other = faces.block_of[c.other];
    if (own != other) {
      faces.between.push_back(i);
    } else {
      ++faces.first_within[own + 1];
    }
    ++faces.first_of_block[own + 1];
    ++faces.first_of_block[other + 1];
  }
  for (std::size_t b = 1; b < faces.first_of_block.size(); ++b) {
    faces.first_of_block[b] += faces.first_of_block[b - 1];
    faces.first_within[b] += faces.first_within[b - 1];
  }
  faces.of_block.resize(2 * faces.active.size());
  faces.within.resize(faces.first_within.back());
  std::vector<std::int32_t> next = faces.first_of_block, next_within = faces.first_within;
  for (const std::int32_t i : faces.active) {
    const std::int32_t own = faces.block_of[faces.all[i].facet];
    const std::int32_t other = faces.block_of[faces.all[i].other];
    faces.of_block[next[own]++] = 2 * i;
    faces.of_block[next[other]++] = 2 * i + 1;
    if (own == other) faces.within[next_within[own]++] = i;
  }
}

FacetMotion motion_of(const TouchingTissue& s, std::int32_t facet) {
  return facet_motion(body_of(s, facet), block_of(s, facet), facet_of(s, facet), s.nodes);
}

void look_at_due(TouchingTissue& s, double dt, bool all) {
  FaceContacts& faces = s.faces;
  // What is half way to its next look is looked at now, too.
  std::vector<std::int32_t> due, facets;
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    const FaceContact& c = faces.all[i];
    const double half_way = 0.5 * (c.looked_at + c.look_at);
    if (all || is_due(half_way - s.time, dt)) due.push_back(static_cast<std::int32_t>(i));
  }
  if (!all) {
    std::vector<std::uint8_t> is_needed(faces.motion.size(), 0);
    for (const std::int32_t i : due) {
      const FaceContact& c = faces.all[i];
      is_needed[c.facet] = 1;
      if (c.other >= 0) is_needed[c.other] = 1;
      for (int n = faces.first_near[i]; n < faces.first_near[i + 1]; ++n) {
        is_needed[faces.near[n]] = 1;
      }
    }
    for (std::size_t f = 0; f < is_needed.size(); ++f) {
      if (is_needed[f] != 0) facets.push_back(static_cast<std::int32_t>(f));
    }
    s.cpu->for_each(
        static_cast<int>(facets.size()),
        [&](int i) { faces.motion[facets[i]] = motion_of(s, facets[i]); }, 32);
  }
  std::vector<float> speed(due.size());
  s.cpu->for_each(
      static_cast<int>(due.size()),
      [&](int i) {
        ContactFaces contact(s, due[i]);
        FaceContact& c = faces.all[due[i]];
        const auto since = static_cast<float>(s.time - c.looked_at);
        speed[i] = look(contact, c, static_cast<float>(dt), since);
        c.looked_at = s.time;
      },
      32);
  faces.active.clear();  // those that may touch before the next look
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    if (is_active(faces.all[i])) faces.active.push_back(static_cast<std::int32_t>(i));
  }
  index_active(faces);
  for (std::size_t i = 0; i < due.size(); ++i) {
    faces.all[due[i]].look_at = s.time + look_horizon(speed[i], s.scene.cell_size, dt);
  }
  double next = s.time + kLongestLook * dt;
  for (const FaceContact& c : faces.all) next = std::min(next, c.look_at);
  faces.until_look = next - s.time;
}

}  // namespace tissue_sim
