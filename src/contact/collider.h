// Colliders: rigid shapes that push tissue. Where they are, and how deep a place lies in them.
#pragma once

#include <cmath>

#include "compute/host_device.h"

namespace tissue_sim {

struct Collider {
  enum Kind { kPlane, kCapsule, kBlade, kJaw } kind = kPlane;
  float position[3] = {};                           ///< of the tip; of a point of the plane [m]
  float rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< local to world, row-major
  float velocity[3] = {};                           ///< of the tip [m/s]
  float spin[3] = {};                               ///< angular velocity, world axes [rad/s]
  float length = 0;     ///< capsule, blade, jaw: along local -z from the tip [m]
  float radius = 0;     ///< capsule, jaw [m]
  float width = 0;      ///< blade: along local -x from the edge [m]
  float thickness = 0;  ///< blade: along local y [m]
  float friction = 0;   ///< Coulomb
  float cohesion = 0;   ///< what holds a point beside friction: a jaw's teeth [N]
  int tool = -1;        ///< index into Scene::tools, -1 for the ground
};

/// What tissue does to a collider: force [N] and moment about its position [N m], world axes.
struct ColliderLoad {
  double force[3] = {}, torque[3] = {};
  double points = 0;  ///< number of those that touch; on a GPU, of those that touch a jaw
};

/// Distance to the surface (negative inside) and the outward normal, world axes.
struct Gap {
  float distance;
  float normal[3];
};

TISSUE_SIM_INLINE void to_local(const Collider& c, const float* x, float* local) {
  const float d[3] = {x[0] - c.position[0], x[1] - c.position[1], x[2] - c.position[2]};
  for (int i = 0; i < 3; ++i) {
    local[i] = c.rotation[i] * d[0] + c.rotation[3 + i] * d[1] + c.rotation[6 + i] * d[2];
  }
}

TISSUE_SIM_INLINE void to_world(const Collider& c, const float* local, float* x) {
  for (int i = 0; i < 3; ++i) {
    x[i] = c.position[i] + c.rotation[3 * i] * local[0] + c.rotation[3 * i + 1] * local[1] +
           c.rotation[3 * i + 2] * local[2];
  }
}

/// The half space below the plane (normal local z); the capsule from the tip up the shaft; the half
/// of such a capsule at local x < 0, which is a jaw; the two flats of the blade (its edge does not
/// push: it cuts).
TISSUE_SIM_INLINE Gap gap(const Collider& c, const float* x) {
  float p[3], n[3] = {0, 0, 1}, distance = 1e30f;
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) {
    distance = p[2];
  } else if (c.kind != Collider::kBlade) {
    const float along = fminf(fmaxf(p[2], -c.length), -c.radius);
    const float d[3] = {p[0], p[1], p[2] - along};
    const float r = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    distance = r - c.radius;
    if (r > 0) {
      for (int i = 0; i < 3; ++i) n[i] = d[i] / r;
    } else {
      n[0] = 1, n[2] = 0;
    }
    if (c.kind == Collider::kJaw && p[0] > distance) {
      distance = p[0];
      n[0] = 1, n[1] = n[2] = 0;
    }
  } else if (p[0] >= -c.width && p[0] <= 0 && p[2] >= -c.length && p[2] <= 0) {
    distance = fabsf(p[1]) - 0.5f * c.thickness;
    n[1] = p[1] < 0 ? -1.0f : 1.0f;
    n[2] = 0;
  }
  Gap g{distance, {0, 0, 0}};
  for (int i = 0; i < 3; ++i) {
    g.normal[i] =
        c.rotation[3 * i] * n[0] + c.rotation[3 * i + 1] * n[1] + c.rotation[3 * i + 2] * n[2];
  }
  return g;
}

/// How far a place must move at least until gap() tells that it touches [m].
TISSUE_SIM_INLINE float clearance(const Collider& c, const float* x) {
  if (c.kind != Collider::kBlade) return gap(c, x).distance;
  float p[3];
  to_local(c, x, p);
  return fmaxf(fabsf(p[1]) - 0.5f * c.thickness,
               fmaxf(fmaxf(p[0], -c.width - p[0]), fmaxf(p[2], -c.length - p[2])));
}

/// Velocity of the collider's material at x [m/s].
TISSUE_SIM_INLINE void velocity_at(const Collider& c, const float* x, float* v) {
  const float d[3] = {x[0] - c.position[0], x[1] - c.position[1], x[2] - c.position[2]};
  v[0] = c.velocity[0] + c.spin[1] * d[2] - c.spin[2] * d[1];
  v[1] = c.velocity[1] + c.spin[2] * d[0] - c.spin[0] * d[2];
  v[2] = c.velocity[2] + c.spin[0] * d[1] - c.spin[1] * d[0];
}

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
