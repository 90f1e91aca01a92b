// What a tool or the ground pushes tissue with where it touches: one law for the CPU and the GPU.
#pragma once

#include <cstdint>

#include "contact/contact_spring.h"
#include "contact/surface_spring.h"

namespace tissue_sim {

/// The tissue that is pushed, on its lattice, and by which tool.
struct PushedTissue {
  float modulus, density;  ///< P-wave modulus [Pa], [kg/m^3]
  float cell_size;         ///< [m]
  float stiffer;           ///< stiffer_across() of the tool
  SurfaceSpring spring;    ///< surface_spring() of a unit of area
};
/// For a tool whose tip has this radius, or has none, and substeps of dt.
TISSUE_SIM_INLINE PushedTissue pushed_tissue(float modulus, float density, float cell_size,
                                             float radius, float dt) {
  return {modulus, density, cell_size, stiffer_across(radius, cell_size),
          surface_spring(modulus, density, cell_size, 1, dt)};
}

/// A place on the surface.
struct PushedPlace {
  const float *x, *v;       ///< [m], [m/s]
  float area;               ///< [m^2]
  float parts = 1;          ///< that it is one of so many of
  float most = kUnbounded;  ///< that it is pushed with [N]
};

/// What a place remembers of a collider that it touches.
struct ToolMemory {
  float hold[3];             ///< place that friction holds on to, in the collider's frame [m]
  float begun = 0;           ///< depth from which on it is pushed back [m]
  std::uint8_t doubled = 0;  ///< how often its spring along the surface was
};

struct ToolPush {
  float force[3];  ///< [N]
  float across;    ///< stiffness across the surface, beside which its added mass stands [N/m]
};

/// In a substep of dt seconds. `is_held`: it touched before. mobility(per_mass) is per_mass times
/// the sum of w^2 / m over the nodes of the place, or anything not above 1 where that is not.
template <class Mobility>
TISSUE_SIM_INLINE ToolPush push_tool(const PushedTissue& tissue, const PushedPlace& place,
                                     const Collider& collider, const Gap& g, bool is_held, float dt,
                                     const Mobility& mobility, ToolMemory& memory) {
  constexpr float kAlongBorne = 0.1f;  // of a place's springs along it, times dt^2 / m
  const int doubled =
      doubled_along(tissue.modulus, tissue.density, tissue.cell_size, dt, memory.doubled);
  if (is_held && doubled > memory.doubled) {  // with the force that it has
    float held[3];
    to_world(collider, memory.hold, held);
    const float share = 1 / static_cast<float>(1 << (doubled - memory.doubled));
    for (int a = 0; a < 3; ++a) held[a] = place.x[a] + share * (held[a] - place.x[a]);
    to_local(collider, held, memory.hold);
  }
  memory.doubled = static_cast<std::uint8_t>(doubled);
  SurfaceSpring spring = scaled(tissue.spring, place.area);
  stiffen_along(spring, doubled);
  stiffen_across(spring, tissue.stiffer);
  if (place.most < kUnbounded) spring.most = place.most;
  const float unit_area = 0.25f * tissue.cell_size * tissue.cell_size;
  spring.cohesion = collider.cohesion * place.area / unit_area;
  // Along the surface no added mass helps: at rims and on debris, whose nodes are light, the spring
  // is what the substep bears.
  const float light = mobility(place.parts * spring.along * dt * dt / kAlongBorne);
  if (light > 1) {
    spring.along /= light;
    spring.damping_along /= light;
  }
  ToolPush push;
  push.across = spring.across;
  surface_force(collider, g, spring, place.x, place.v, memory.hold, memory.begun, push.force);
  return push;
}

/// The same of a point by itself, within the tissue, in a crack, on a flake: no added mass stands
/// beside its spring.
TISSUE_SIM_INLINE void push_point(const ContactSpring& soft, const float* x, const float* v,
                                  const Collider& collider, const Gap& g, ToolMemory& memory,
                                  float* force) {
  const SurfaceSpring spring{soft.stiffness, soft.stiffness,    soft.damping,
                             soft.damping,   collider.cohesion, kUnbounded};
  memory.begun = 0;
  surface_force(collider, g, spring, x, v, memory.hold, memory.begun, force);
}

}  // namespace tissue_sim
