// The spring between a point of tissue and a collider.
#pragma once

#include <cmath>

#include "compute/host_device.h"
#include "tools/collider.h"

namespace tissue_sim {

/// What a point needs for its contact: a spring and a damper along the normal that only push, and a
/// spring that holds the place where it first touched, within the friction cone (Cundall and Strack
/// 1979), which cohesion makes wider.
struct ContactSpring {
  float stiffness;  ///< [N/m]
  float damping;    ///< [N s/m]
};

// Stiffness of a contact spring in units of the P-wave modulus over a point's edge: half of it
// makes contact about as stiff as one layer of points, and adds less to the highest frequency than
// tissue.
inline constexpr float kContactStiffness = 0.5f;
inline constexpr float kContactDamping = 0.1f;  ///< share of critical

/// The spring of a point of `volume` [m^3], `edge` [m] apart from the next, in tissue of this
/// P-wave modulus [Pa] and density [kg/m^3]. Both of its figures are in proportion to the volume.
TISSUE_SIM_INLINE ContactSpring contact_spring(float modulus, float density, float edge,
                                               float volume) {
  const float k = kContactStiffness * modulus * volume / (edge * edge);
  return {k, 2 * kContactDamping * sqrtf(k * density * volume)};
}

/// Force on the point at x with velocity v, in contact (`g.distance` < 0). `hold` is the place, in
/// the collider's frame, that friction holds on to; it slides with the point where the cone is
/// reached.
TISSUE_SIM_INLINE void contact_force(const Collider& c, const Gap& g, const ContactSpring& spring,
                                     const float* x, const float* v, float* hold, float* force) {
  float vc[3], held[3], rel[3];
  velocity_at(c, x, vc);
  to_world(c, hold, held);
  float vn = 0, sn = 0;
  for (int i = 0; i < 3; ++i) {
    rel[i] = v[i] - vc[i];
    vn += rel[i] * g.normal[i];
    sn += (x[i] - held[i]) * g.normal[i];
  }
  const float push = fmaxf(0.0f, -spring.stiffness * g.distance - spring.damping * vn);
  float t[3], t2 = 0;
  for (int i = 0; i < 3; ++i) {
    t[i] = -spring.stiffness * (x[i] - held[i] - sn * g.normal[i]) -
           spring.damping * (rel[i] - vn * g.normal[i]);
    t2 += t[i] * t[i];
  }
  const float limit = c.friction * push + c.cohesion;
  if (t2 > limit * limit) {
    const float scale = limit / sqrtf(t2);
    float moved[3];
    for (int i = 0; i < 3; ++i) {
      t[i] *= scale;
      moved[i] = x[i] + t[i] / spring.stiffness;
    }
    to_local(c, moved, hold);
  }
  for (int i = 0; i < 3; ++i) force[i] = push * g.normal[i] + t[i];
}

}  // namespace tissue_sim
