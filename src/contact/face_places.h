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

/// Material of a facet: where its points are of several, that of the lowest.
inline const Material& material_of(const MpmState& s, std::int32_t facet) {
  return body_of(s, facet).material_of(s.points, facet_of(s, facet).point);
}

/// Reference place that a contact holds on to [m].
inline Vec3 place_held(const MpmState& s, const FaceContact& c) {
  return reference_place(body_of(s, c.other), block_of(s, c.other), facet_of(s, c.other).cell,
                         c.hold);
}

/// Sets the place on the other face that a contact holds on to, and what follows from it.
inline void hold_at(FaceContact& c, const float (&place)[3]) {
  c.hold_at(place);
  c.other_weights = AxisWeights(c.hold);
}

/// Sum of w^2 / m over the nodes of a place: what a spring there moves, as one over a mass [1/kg].
inline double mobility(const Nodes& nodes, const CellNodes& cell, const AxisWeights& weights) {
  double sum = 0;
  for (int k = 0; k < 27; ++k) {
    const float w = weights.of[k % 3] * weights.of[3 + k / 3 % 3] * weights.of[6 + k / 9];
    const int node = cell.lowest[k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3];
    sum += static_cast<double>(w) * w * nodes.inv_mass[node];
  }
  return sum;
}

/// The places of a contact on the CPU: see push_face().
struct ContactPlaces {
  const Nodes& nodes;
  FaceContact& contact;

  void own(float (&value)[3]) const { value_at(nodes.u, contact.nodes, contact.weights, value); }
  void held(float (&value)[3]) const {
    value_at(nodes.u, contact.other_nodes, contact.other_weights, value);
  }
  void hold(const float (&place)[3]) { contact.other_weights = AxisWeights(place); }
  float held_mobility() const {
    return static_cast<float>(mobility(nodes, contact.other_nodes, contact.other_weights));
  }
};

/// From the place held to the facet's centre, in the world.
inline void measure_apart(const MpmState& s, FaceContact& c) {
  float own[3], held[3];
  const ContactPlaces places{s.nodes, c};
  places.own(own);
  places.held(held);
  c.measure_apart(own, held);
}

/// Makes the spring so soft that substeps of `dt` can follow what it moves, and the damper to it.
inline void soften(const MpmState& s, FaceContact& c, double dt) {
  c.soften(ContactPlaces{s.nodes, c}.held_mobility(), static_cast<float>(dt));
}

}  // namespace tissue_sim
