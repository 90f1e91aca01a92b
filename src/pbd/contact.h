// A vertex and a collider that it lies in: on the CPU and on the GPU.
#pragma once

#include <cmath>

#include "pbd/motion.h"
#include "tools/collider.h"

namespace tissue_sim {
namespace pbd {

/// What lies deep in a tool that has just appeared comes out at this speed, and no faster [m/s].
constexpr float kWayOut = 1;

/// What a vertex does to a collider: force [N] and moment about its position [N m].
struct ContactPush {
  double force[3], torque[3];
  float distance;  ///< from the collider afterwards; below 0 where it lies in it still [m]
};

/// Where a vertex is, rounded (Vertices); `rest` becomes what that rounds off, and of a gap that
/// was found with it gap_of() is the true one: in short steps what is rounded off would be a push.
struct RoundedPlace {
  float at[3], rest[3];
};
TISSUE_SIM_INLINE RoundedPlace place_of(const float* x, const float* moved) {
  RoundedPlace p;
  for (int a = 0; a < 3; ++a) p.at[a] = sum_and_rest(x[a], moved[a], p.rest[a]);
  return p;
}
TISSUE_SIM_INLINE Gap gap_of(const Collider& collider, const RoundedPlace& p) {
  Gap g = gap(collider, p.at);
  for (int a = 0; a < 3; ++a) g.distance += g.normal[a] * p.rest[a];
  return g;
}

/// Moves a vertex of `mass` kg that is at `at` out of the collider, inelastic, with Coulomb
/// friction, in a step of h seconds in which it went from predicted - h v to `moved`, which
/// changes.
TISSUE_SIM_INLINE ContactPush push_out(const Collider& collider, const Gap& g, float h, double mass,
                                       const float* predicted, const float* v, const float* at,
                                       float inverse_mass, float* moved) {
  float carried[3];  // with the collider's material, in this step
  velocity_at(collider, at, carried);
  float slid[3], normal_way = 0, approach = 0;
  for (int a = 0; a < 3; ++a) {
    carried[a] *= h;
    const float start = predicted[a] - h * v[a];
    slid[a] = moved[a] - start - carried[a];
    normal_way += slid[a] * g.normal[a];
  }
  approach = fmaxf(0.0f, -normal_way);
  const float out = fminf(-g.distance, approach + h * kWayOut);
  float s2 = 0;
  for (int a = 0; a < 3; ++a) {
    slid[a] -= normal_way * g.normal[a];
    s2 += slid[a] * slid[a];
  }
  // Friction takes back what slid, up to its share of the push; teeth hold with a force.
  const float hold = collider.friction * out + collider.cohesion * h * h * inverse_mass;
  const float back = s2 > hold * hold ? hold / sqrtf(s2) : 1.0f;
  const double weight = mass / (static_cast<double>(h) * h);
  ContactPush push;
  push.distance = g.distance + out;
  double arm[3];
  for (int a = 0; a < 3; ++a) {
    const float was = moved[a];
    moved[a] += out * g.normal[a] - back * slid[a];
    const float by = moved[a] - was;  // as it was rounded: that is what the vertex gets
    push.force[a] = -weight * by;
    arm[a] = at[a] + by - collider.position[a];
  }
  push.torque[0] = arm[1] * push.force[2] - arm[2] * push.force[1];
  push.torque[1] = arm[2] * push.force[0] - arm[0] * push.force[2];
  push.torque[2] = arm[0] * push.force[1] - arm[1] * push.force[0];
  return push;
}

/// So deep a triangle may lie in a tip before it is pushed, beside its corners: a mesh that fits
/// the tip does, for its triangles are chords [m].
TISSUE_SIM_INLINE float chord(float edge, float radius) {
  return fminf(edge * edge / (8 * radius), 0.25f * radius);
}

}  // namespace pbd
}  // namespace tissue_sim
