// Facets by their number, and the material places that contacts hold on to.
#pragma once

#include <algorithm>
#include <cmath>

#include "contact/collider.h"
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

/// Makes the spring so soft that substeps of `dt` can follow what it moves, and the damper to it.
inline void soften(const MpmState& s, FaceContact& c, double dt) {
  constexpr double kStable = 0.35;  // stiffness * dt^2 / mass, at most; many springs share nodes
  const double mass = 1 / (mobility(s.nodes, c.nodes, c.weights) +
                           mobility(s.nodes, c.other_nodes, c.other_weights) + 1e-30);
  c.stiffness = std::min(c.stiffness, static_cast<float>(kStable * mass / (dt * dt)));
  c.damping = 2 * kContactDamping * std::sqrt(c.stiffness * static_cast<float>(mass));
}

/// Whether the place held is still on the other face: near its cell, and not far from the facet.
inline bool holds(const FaceContact& c, double cell_size) {
  constexpr float kFarthest = 1.25f;  // [cells]
  const auto far = static_cast<float>(0.75 * cell_size);
  return dot(c.apart, c.apart) < far * far && std::fabs(c.hold[0]) < kFarthest &&
         std::fabs(c.hold[1]) < kFarthest && std::fabs(c.hold[2]) < kFarthest;
}

}  // namespace tissue_sim
