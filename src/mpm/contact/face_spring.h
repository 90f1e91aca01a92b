// The spring between two faces that touch: what a contact is within a substep, on the CPU and on
// the GPU.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/host_device.h"
#include "contact/contact_spring.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

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
  float own_mobility;                  ///< sum of w^2 / m at the facet's centre [1/kg]
  float sudden;                        ///< depth at which nothing can be from one substep [m]
  float force[3];                      ///< on the facet [N]
  bool touching = false;
  std::int32_t facet = -1, other = -1;  ///< numbers over all blocks; other -1: nothing near
  float depth = 0;  ///< of the facet's centre below the other face, as of the last look [cells]
  float begun = 0;  ///< depth at which the place held may stay, for there it began [cells]

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

  /// Makes the spring so soft that substeps of `dt` can follow what it moves, and the damper to it;
  /// `held_mobility` is the sum of w^2 / m at the place held [1/kg].
  TISSUE_SIM_INLINE void soften(float held_mobility, float dt) {
    constexpr float kStable = 0.35f;  // stiffness * dt^2 / mass, at most; springs share nodes
    const float mass = 1 / (own_mobility + held_mobility + 1e-30f);
    stiffness = fminf(stiffness, kStable * mass / (dt * dt));
    constexpr float kDamping = 0.3f;  // share of critical
    damping = 2 * kDamping * sqrtf(stiffness * mass);
  }

  /// Whether the place held is at most so far from the facet [cells].
  TISSUE_SIM_INLINE bool is_within(double cells) const {
    const auto far = static_cast<float>(cells * cell_size);
    return dot(apart, apart) < far * far;
  }

  /// Whether the place held is still on the other face: near its cell, and not far from the facet.
  TISSUE_SIM_INLINE bool holds() const {
    constexpr float kFarthest = 1.25f;  // [cells]
    return is_within(0.75) && fabsf(hold[0]) < kFarthest && fabsf(hold[1]) < kFarthest &&
           fabsf(hold[2]) < kFarthest;
  }
  TISSUE_SIM_FIELDS(from_middle, cell_size, hold, between, apart, normal, to_reference, stiffness,
                    damping, friction, own_mobility, sudden, force, touching, facet, other, depth,
                    begun)
};

/// Works out the force of a contact after a substep of `dt` seconds, and lets it slide. `places`
/// knows displacements [m]: places.own(u) of the facet's centre, places.held(u) of the place held,
/// which places.hold(place) sets, and places.held_mobility() [1/kg]. Where several contacts are
/// worked out in step, places.any(so) says whether it is so for any of them, and those that are not
/// `active` come along. A place that slid too far comes back onto the cone: in a substep it may
/// slide ten times as far as the spring on the cone is long, and a tenth too far there would be no
/// friction; and what pressed before sticks where it cannot slide, as on a face that slopes more
/// than its normal says, until it parts, slides again or is too far away.
template <class Places>
TISSUE_SIM_INLINE void push_face(FaceSpring& c, float dt, Places& places, bool active = true) {
  float own[3], held[3];
  const float depth_before = -dot(c.apart, c.normal);
  places.own(own);
  places.held(held);
  c.measure_apart(own, held);
  float depth = -dot(c.apart, c.normal);
  const float closing = (depth - depth_before) / dt;  // [m/s]
  const float length2 = dot(c.apart, c.apart);
  c.force[0] = c.force[1] = c.force[2] = 0;
  // What comes out of the blue is for the next look to tell.
  const bool touched = c.touching, sudden = !touched && depth > c.sudden;
  c.touching = active && depth > 0 && !sudden;
  if (!places.any(c.touching)) return;
  // The place held slides along the face, so that the spring stays in the friction cone.
  constexpr float kOnCone = 1.02f;
  constexpr double kPressed = 1.5;  // what a tool presses at 1 m/s comes a cell deep [cells]
  float aside[3];
  const float before[3] = {c.hold[0], c.hold[1], c.hold[2]};
  float way[3] = {}, left[3];  // which way it slides, unit; what is left of it [m]
  bool goes_on = true;         // sliding
  for (int i = 0; i < 4; ++i) {
    for (int a = 0; a < 3; ++a) aside[a] = c.apart[a] + depth * c.normal[a];
    const float slip = sqrtf(dot(aside, aside));
    bool slides = c.touching && slip > kOnCone * c.friction * depth;
    constexpr float kOff = kOnCone - 1;
    const float cone = c.friction * depth;
    for (int a = 0; a < 3; ++a) {
      if (i == 0 && slides) way[a] = aside[a] / slip;
      left[a] = aside[a] - cone * way[a];
    }
    if (i > 0) slides = c.touching && dot(left, left) > kOff * kOff * cone * cone;
    goes_on = slides = slides && goes_on;
    if (i == 3 || !places.any(slides)) break;
    if (slides) {
      float place[3];
      for (int a = 0; a < 3; ++a) {
        place[a] = c.hold[a] + dot(c.to_reference + 3 * a, left);
      }
      c.hold_at(place);
      places.hold(place);
    }
    places.held(held);
    bool undone = false;  // it slid where it cannot, and is put back
    if (slides) {
      c.measure_apart(own, held);
      depth = -dot(c.apart, c.normal);
      // Not what it looked like, or beyond what is left of the face.
      c.touching = depth > 0 && dot(c.apart, c.apart) <= length2 && c.holds();
      undone = touched && depth > 0 && !c.touching;
      if (undone) {
        c.hold_at(before);
        places.hold(before);
      }
    }
    if (places.any(undone)) {
      places.held(held);
      if (undone) {
        goes_on = false;
        c.measure_apart(own, held);
        depth = -dot(c.apart, c.normal);
        for (int a = 0; a < 3; ++a) aside[a] = c.apart[a] + depth * c.normal[a];
        c.touching = depth > 0 && c.is_within(kPressed);
      }
    }
    const bool begins = slides && c.touching && !touched;
    if (places.any(begins)) {
      const float mobility = places.held_mobility();
      if (begins) c.soften(mobility, dt);
    }
  }
  if (!c.touching) return;
  // Along the line between the two material places, or angular momentum would change; and only
  // apart. Where the place could not slide onto the cone it is as strong as on it.
  float push = fmaxf(0.0f, c.stiffness * depth + c.damping * closing);
  const float slip2 = dot(aside, aside), on_cone = kOnCone * c.friction * depth;
  if (slip2 > on_cone * on_cone) {
    push *= sqrtf((depth * depth + on_cone * on_cone) / (depth * depth + slip2));
  }
  const float along = 1 / depth;
  for (int a = 0; a < 3; ++a) c.force[a] = push * (c.normal[a] - along * aside[a]);
}

// What is remembered of contacts while blocks, and the numbers of facets, are made anew.

/// What a contact is known by while blocks are made anew.
struct KeptContact {
  std::int32_t point;      ///< of the facet
  std::int32_t direction;  ///< of the facet
  std::int32_t other_body;
  double hold[3];  ///< reference place [m]
  float depth, begun, stiffness, apart[3];
  double looked_at;  ///< on the CPU, when last [s]

  TISSUE_SIM_INLINE bool is_before(std::int32_t p, int d) const {
    return point != p ? point < p : direction < d;
  }
  TISSUE_SIM_FIELDS(point, direction, other_body, hold, depth, begun, stiffness, apart, looked_at)
};

/// The one of these, sorted, that a facet had; null if none.
TISSUE_SIM_INLINE const KeptContact* find_kept(const KeptContact* kept, int count,
                                               const Facet& facet) {
  int begin = 0, end = count;
  while (begin < end) {
    const int middle = (begin + end) / 2;
    if (kept[middle].is_before(facet.point, facet.direction)) {
      begin = middle + 1;
    } else {
      end = middle;
    }
  }
  const bool found =
      begin < count && kept[begin].point == facet.point && kept[begin].direction == facet.direction;
  return found ? kept + begin : nullptr;
}

}  // namespace tissue_sim
