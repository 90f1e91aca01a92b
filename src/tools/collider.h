// Colliders: rigid shapes that push tissue. Where they are, and how deep a place lies in them.
#pragma once

#include <cmath>

#include "compute/host_device.h"

namespace tissue_sim {

struct Collider {
  enum Kind { kPlane, kCapsule, kBlade, kJaw, kPunch, kPlate } kind = kPlane;
  float position[3] = {};                           ///< of the tip; of a point of the plane [m]
  float rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< local to world, row-major
  float velocity[3] = {};                           ///< of the tip [m/s]
  float spin[3] = {};                               ///< angular velocity, world axes [rad/s]
  float length = 0;                                 ///< along local -z from the tip [m]
  float radius = 0;                                 ///< capsule, jaw, punch [m]
  float width = 0;      ///< blade: along local -x from the edge; plate: along local x [m]
  float thickness = 0;  ///< blade, plate: along local y [m]
  float edge = 0;       ///< punch, plate: radius of the rounded edge [m]
  float friction = 0;   ///< Coulomb
  float cohesion = 0;   ///< what holds a point beside friction: a jaw's teeth [N]
  float inside = 0;     ///< deeper than this a point is in it, not at it; 0: that is not asked [m]
  int tool = -1;        ///< index into Scene::tools, -1 for the ground
};

/// In which a GPU sums up how deep the deepest point lies [m].
inline constexpr float kInsideUnit = 1e-9f;

/// What tissue does to a collider: force [N] and moment about its position [N m], world axes.
struct ColliderLoad {
  double force[3] = {}, torque[3] = {};
  double points = 0;   ///< number of those that touch; on a GPU, of those that touch a jaw
  double inside = 0;   ///< number of those that lie deeper than Collider::inside
  double deepest = 0;  ///< of these [m]

  /// The collider pushes points at this place with this force.
  void push(const Collider& collider, const float* place, const float* force_on_points,
            double points_there) {
    points += points_there;
    double arm[3];
    for (int a = 0; a < 3; ++a) {
      force[a] -= force_on_points[a];
      arm[a] = static_cast<double>(place[a]) - collider.position[a];
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      torque[a] -= arm[b] * force_on_points[d] - arm[d] * force_on_points[b];
    }
  }
  /// Counts a point at this distance from the collider.
  void count_inside(const Collider& collider, float distance) {
    if (!(collider.inside > 0 && distance < -collider.inside)) return;
    inside += 1;
    if (-distance > deepest) deepest = -distance;
  }
  /// What acts on the same collider elsewhere.
  void add(const ColliderLoad& other) {
    for (int a = 0; a < 3; ++a) {
      force[a] += other.force[a];
      torque[a] += other.torque[a];
    }
    points += other.points;
    add_inside(other);
  }
  void add_inside(const ColliderLoad& other) {
    inside += other.inside;
    if (other.deepest > deepest) deepest = other.deepest;
  }
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

/// Distance of p from a box about the origin with these half edges, negative inside, and the unit
/// normal there; with `axes` = 2 from a rectangle.
TISSUE_SIM_INLINE float box_distance(const float* p, const float* half, int axes, float* n) {
  float outside2 = 0, inside = -1e30f;
  int nearest = 0;
  for (int i = 0; i < axes; ++i) {
    const float d = fabsf(p[i]) - half[i];
    n[i] = d > 0 ? copysignf(d, p[i]) : 0;
    outside2 += n[i] * n[i];
    if (d > inside) inside = d, nearest = i;
  }
  if (outside2 > 0) {
    const float outside = sqrtf(outside2);
    for (int i = 0; i < axes; ++i) n[i] /= outside;
    return outside;
  }
  n[nearest] = copysignf(1.0f, p[nearest]);
  return inside;
}

/// The cylinder up the shaft from the tip, or the box, with rounded edges: p is local.
TISSUE_SIM_APART float rounded_distance(const Collider& c, const float* p, float* n) {
  if (c.kind == Collider::kPlate) {
    const float half[3] = {0.5f * c.width - c.edge, 0.5f * c.thickness - c.edge,
                           0.5f * c.length - c.edge};
    const float q[3] = {p[0], p[1], p[2] + 0.5f * c.length};
    return box_distance(q, half, 3, n) - c.edge;
  }
  const float s = sqrtf(p[0] * p[0] + p[1] * p[1]);
  const float q[2] = {s, p[2] + 0.5f * c.length};
  const float half[2] = {c.radius - c.edge, 0.5f * c.length - c.edge};
  float m[2];
  const float distance = box_distance(q, half, 2, m) - c.edge;
  n[0] = s > 0 ? m[0] * p[0] / s : m[0];
  n[1] = s > 0 ? m[0] * p[1] / s : 0;
  n[2] = m[1];
  return distance;
}

/// The half space below the plane (normal local z); the capsule from the tip up the shaft; the half
/// of such a capsule at local x < 0, which is a jaw; the two flats of the blade (its edge does not
/// push: it cuts); the punch and the plate with their edges rounded.
TISSUE_SIM_INLINE Gap gap(const Collider& c, const float* x) {
  float p[3], n[3] = {0, 0, 1}, distance = 1e30f;
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) {
    distance = p[2];
  } else if (c.kind >= Collider::kPunch) {
    distance = rounded_distance(c, p, n);
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

}  // namespace tissue_sim
