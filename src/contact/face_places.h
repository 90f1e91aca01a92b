// Facets by their number, and the material places that contacts hold on to.
#pragma once

#include <cmath>

#include "contact/face_contact.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

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
inline void hold_at(const MpmState& s, FaceContact& c, const float (&place)[3]) {
  const std::int32_t f = c.facet, o = c.other;
  const Vec3 between = reference_place(body_of(s, f), block_of(s, f), facet_of(s, f)) -
                       reference_place(body_of(s, o), block_of(s, o), facet_of(s, o).cell, place);
  for (int a = 0; a < 3; ++a) {
    c.hold[a] = place[a];
    c.between[a] = static_cast<float>(between[a]);
  }
  c.other_weights = AxisWeights(c.hold);
}

/// From the place held to the facet's centre, in the world [m].
inline void measure_apart(const MpmState& s, const FaceContact& c, float (&apart)[3]) {
  float u[3], other[3];
  value_at(s.nodes.u, c.nodes, c.weights, u);
  value_at(s.nodes.u, c.other_nodes, c.other_weights, other);
  for (int a = 0; a < 3; ++a) apart[a] = c.between[a] + (u[a] - other[a]);
}

/// Whether the place held is still on the other face: near its cell, and not far from the facet.
inline bool holds(const FaceContact& c, double cell_size) {
  constexpr float kFarthest = 1.25f;  // [cells]
  const auto far = static_cast<float>(0.75 * cell_size);
  return dot(c.apart, c.apart) < far * far && std::fabs(c.hold[0]) < kFarthest &&
         std::fabs(c.hold[1]) < kFarthest && std::fabs(c.hold[2]) < kFarthest;
}

}  // namespace tissue_sim
