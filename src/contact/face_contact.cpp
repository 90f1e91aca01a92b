#include "contact/face_contact.h"

#include <algorithm>
#include <cmath>

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

void push_faces(const MpmState& state, FaceContact& c, float dt) {
  float apart[3];
  measure_apart(state, c, apart);
  float depth = -dot(apart, c.normal);
  const float closing = (depth + dot(c.apart, c.normal)) / dt;  // [m/s]
  std::copy(apart, apart + 3, c.apart);
  std::fill(c.force, c.force + 3, 0.0f);
  // What comes out of the blue is for the next look to tell.
  const bool touched = c.touching, sudden = !touched && depth > c.sudden;
  c.touching = depth > 0 && !sudden;
  if (!c.touching) return;
  // The place held slides along the face, so that the spring stays in the friction cone.
  constexpr float kOnCone = 1.02f;
  float aside[3], slip = 0;
  for (int i = 0; i < 4; ++i) {
    for (int a = 0; a < 3; ++a) aside[a] = c.apart[a] + depth * c.normal[a];
    slip = std::sqrt(dot(aside, aside));
    if (slip <= kOnCone * c.friction * depth || i == 3) break;
    const float share = 1 - c.friction * depth / slip;
    float place[3];
    for (int a = 0; a < 3; ++a) {
      place[a] = c.hold[a] + share * dot(c.to_reference + 3 * a, aside);
    }
    hold_at(state, c, place);
    measure_apart(state, c, c.apart);
    depth = -dot(c.apart, c.normal);
    // Not what it looked like, or beyond what is left of the face.
    c.touching = depth > 0 && dot(c.apart, c.apart) <= dot(apart, apart) &&
                 holds(c, body_of(state, c.other).cell_size);
    if (!c.touching) return;
    if (!touched) soften(state, c, dt);
  }
  // Along the line between the two material places, and only apart.
  const float push = std::max(0.0f, c.stiffness * depth + c.damping * closing);
  const float friction = std::min(1.0f, kOnCone * c.friction * depth / (slip + 1e-30f));
  for (int a = 0; a < 3; ++a) c.force[a] = push * (c.normal[a] - friction / depth * aside[a]);
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
