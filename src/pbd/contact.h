// A vertex and a collider that it lies in: on the CPU and on the GPU.
#pragma once

#include <cmath>

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

/// Moves the vertex `at`, of `mass` kg, out of the collider: inelastic, with Coulomb friction, in a
/// step of h seconds in which it went from predicted - h v.
TISSUE_SIM_INLINE ContactPush push_out(const Collider& collider, const Gap& g, float h, double mass,
                                       const float* predicted, const float* v, float* at) {
  float carried[3];  // with the collider's material, in this step
  velocity_at(collider, at, carried);
  float slid[3], normal_way = 0, approach = 0;
  for (int a = 0; a < 3; ++a) {
    carried[a] *= h;
    const float start = predicted[a] - h * v[a];
    slid[a] = at[a] - start - carried[a];
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
  const float hold = collider.friction * out + collider.cohesion * h * h * at[3];
  const float back = s2 > hold * hold ? hold / sqrtf(s2) : 1.0f;
  const double weight = mass / (static_cast<double>(h) * h);
  ContactPush push;
  push.distance = g.distance + out;
  double arm[3];
  for (int a = 0; a < 3; ++a) {
    const float moved = out * g.normal[a] - back * slid[a];
    const float was = at[a];
    at[a] += moved;
    push.force[a] = -weight * (at[a] - was);  // as it was rounded: that is what the vertex gets
    arm[a] = at[a] - collider.position[a];
  }
  push.torque[0] = arm[1] * push.force[2] - arm[2] * push.force[1];
  push.torque[1] = arm[2] * push.force[0] - arm[0] * push.force[2];
  push.torque[2] = arm[0] * push.force[1] - arm[1] * push.force[0];
  return push;
}

}  // namespace pbd
}  // namespace tissue_sim
