// Facets by their number, and the material places that contacts hold on to.
#pragma once

#include "contact/face_contact.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

inline const Block& block_of(const MpmState& s, std::int32_t facet) {
  return *s.blocks.all[s.faces.block_of[facet]];
}

inline const Facet& facet_of(const MpmState& s, std::int32_t facet) {
  return block_of(s, facet).facets[facet - s.faces.first_facet[s.faces.block_of[facet]]];
}

inline const LatticeBody& body_of(const MpmState& s, std::int32_t facet) {
  return s.bodies[block_of(s, facet).body];
}

/// Sets the place on the other face that a contact holds on to, and what follows from it.
inline void hold_at(FaceContact& c, const float (&place)[3]) {
  c.hold_at(place);
  c.other_weights = AxisWeights(c.hold);
}

/// The places of a contact on the CPU: see push_face().
struct ContactPlaces {
  const Array<float>* u;
  FaceContact& contact;

  void own(float (&value)[3]) const { value_at(u, contact.nodes, contact.weights, value); }
  void held(float (&value)[3]) const {
    value_at(u, contact.other_nodes, contact.other_weights, value);
  }
  void hold(const float (&place)[3]) { contact.other_weights = AxisWeights(place); }
};

/// From the place held to the facet's centre, in the world.
inline void measure_apart(const MpmState& s, FaceContact& c) {
  float own[3], held[3];
  const ContactPlaces places{s.nodes.u, c};
  places.own(own);
  places.held(held);
  c.measure_apart(own, held);
}

}  // namespace tissue_sim
