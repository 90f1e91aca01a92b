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
  float apart[3], rate[3];
  measure_apart(state, c, apart);
  for (int a = 0; a < 3; ++a) {
    rate[a] = (apart[a] - c.apart[a]) / dt;
    c.apart[a] = apart[a];
    c.force[a] = 0;
  }
  const float depth = -dot(apart, c.normal);
  const bool touched = c.touching;
  c.touching = depth > 0;
  if (!c.touching) return;
  if (!touched && depth > c.sudden) {  // out of the blue: the next look will tell
    c.touching = false;
    return;
  }
  // What it is held by slides along, so that the spring stays in the friction cone; at the first
  // touch there is no spring along the face.
  float slide[3];
  for (int a = 0; a < 3; ++a) slide[a] = apart[a] + depth * c.normal[a];
  const float slip = std::sqrt(dot(slide, slide)), limit = touched ? c.friction * depth : 0.0f;
  if (slip > limit) {
    float place[3];
    for (int a = 0; a < 3; ++a) {
      place[a] = c.hold[a] + (1 - limit / slip) * dot(c.to_reference + 3 * a, slide);
    }
    hold_at(state, c, place);
    measure_apart(state, c, c.apart);
    if (!touched) soften(state, c, dt);
    if (dot(c.apart, c.apart) > dot(apart, apart)) c.touching = false;  // not what it looked like
  }
  if (!c.touching || !holds(c, body_of(state, c.other).cell_size)) {
    c.touching = false;
    return;
  }
  const float length = std::sqrt(dot(c.apart, c.apart));
  if (!(length > 0)) return;
  // Along the line between the two material places, and only apart.
  const float push = std::max(0.0f, c.stiffness * length + c.damping * dot(rate, c.apart) / length);
  for (int a = 0; a < 3; ++a) c.force[a] = -push / length * c.apart[a];
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
