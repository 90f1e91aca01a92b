// The spring between two faces that touch: what a contact is within a substep, on the CPU and on
// the GPU.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/host_device.h"

namespace tissue_sim {

TISSUE_SIM_INLINE float dot(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A spring and a damper between the centre of a facet and a material place on another face.
struct alignas(16) FaceSpring {
  double from_middle[3];  ///< from the middle of the other's cell to the facet's centre, in
                          ///< reference space [m]
  double cell_size;       ///< of the other body [m]
  float hold[3];          ///< place on the other face [cells, from the middle of its cell]
  float between[3];       ///< from `hold` to the centre in reference space [m]
  float apart[3];         ///< the same in the world, as of the last substep [m]
  float normal[3];        ///< of the other face, in the world
  float to_reference[9];  ///< inverse of its deformation gradient over the cell [1/m]
  float stiffness, damping, friction;  ///< [N/m], [N s/m], [-]
  float sudden;                        ///< depth at which nothing can be from one substep [m]
  float force[3];                      ///< on the facet [N]
  bool touching = false;

  /// Sets the place on the other face that it holds on to.
  TISSUE_SIM_INLINE void hold_at(const float (&place)[3]) {
    for (int a = 0; a < 3; ++a) {
      hold[a] = place[a];
      between[a] = static_cast<float>(from_middle[a] - cell_size * place[a]);
    }
  }

  /// Sets `apart`, from the displacements of the facet's centre and of the place held [m].
  TISSUE_SIM_INLINE void measure_apart(const float (&own)[3], const float (&held)[3]) {
    for (int a = 0; a < 3; ++a) apart[a] = between[a] + (own[a] - held[a]);
  }

  /// Whether the place held is still on the other face: near its cell, and not far from the facet.
  TISSUE_SIM_INLINE bool holds() const {
    constexpr float kFarthest = 1.25f;  // [cells]
    const auto far = static_cast<float>(0.75 * cell_size);
    return dot(apart, apart) < far * far && fabsf(hold[0]) < kFarthest &&
           fabsf(hold[1]) < kFarthest && fabsf(hold[2]) < kFarthest;
  }
};

/// Works out the force of a contact after a substep of `dt` seconds, and lets it slide. `places`
/// knows displacements [m]: places.own(u) of the facet's centre, places.held(u) of the place held,
/// which places.hold(place) sets.
template <class Places>
TISSUE_SIM_INLINE void push_face(FaceSpring& c, float dt, Places& places) {
  float own[3], held[3], before[3], rate[3];
  places.own(own);
  places.held(held);
  for (int a = 0; a < 3; ++a) before[a] = c.apart[a];
  c.measure_apart(own, held);
  for (int a = 0; a < 3; ++a) {
    rate[a] = (c.apart[a] - before[a]) / dt;
    c.force[a] = 0;
  }
  const float depth = -dot(c.apart, c.normal);
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
  for (int a = 0; a < 3; ++a) slide[a] = c.apart[a] + depth * c.normal[a];
  const float slip = sqrtf(dot(slide, slide)), limit = touched ? c.friction * depth : 0.0f;
  if (slip > limit) {
    float place[3];
    for (int a = 0; a < 3; ++a) {
      place[a] = c.hold[a] + (1 - limit / slip) * dot(c.to_reference + 3 * a, slide);
    }
    c.hold_at(place);
    places.hold(place);
    places.held(held);
    c.measure_apart(own, held);
  }
  if (!c.holds()) {
    c.touching = false;
    return;
  }
  const float length = sqrtf(dot(c.apart, c.apart));
  if (!(length > 0)) return;
  // Along the line between the two material places, and only apart.
  const float push = c.stiffness * length + c.damping * dot(rate, c.apart) / length;
  if (!(push > 0)) return;
  for (int a = 0; a < 3; ++a) c.force[a] = -push / length * c.apart[a];
}

}  // namespace tissue_sim
