// The springs between a place on the surface of tissue and a collider.
#pragma once

#include <cmath>

#include "compute/host_device.h"
#include "tools/collider.h"

namespace tissue_sim {

/// Across the surface a stiff one, which hides little of how deep a tool presses; along it one that
/// holds the place where it first touched, within the friction cone (Cundall and Strack 1979).
struct SurfaceSpring {
  float across, along;                  ///< [N/m]
  float damping_across, damping_along;  ///< [N s/m]
  float cohesion;                       ///< what it holds beside friction [N]
  float most;                           ///< that it pushes with [N]
};

/// In units of the P-wave modulus over the cell size, for a unit of area. The stiff spring alone
/// would be too fast for the substeps of tissue: contact_inertia.h slows it down.
inline constexpr float kAcross = 8, kAlong = 0.5f;
inline constexpr float kDampingAcross = 0.1f;  ///< times the substep, of the stiffness
inline constexpr float kDampingAlong = 0.1f;   ///< share of critical
/// Up to how many cells of radius a tool's tip is thin: tissue bears its load on so little area
/// that the spring would hide a third of the radius, and more than what it presses is still thick.
inline constexpr float kThinTip = 4 / 3.0f;
inline constexpr float kAcrossThin = 6;  ///< times the cells in its radius to the power of -2
inline constexpr float kUnbounded = 1e30f;
/// What presses at most on a place of tissue that cannot give way, in units of Young's modulus: a
/// jaw, and any tool where the face of an anchor holds the tissue. With more, rims bear more of
/// what a grasper holds with, and a soft block hangs lower from it; without a bound tissue between
/// jaws is crushed flat, and before a tool that comes into an anchor it is turned inside out. What
/// presses back more lies in the tool.
inline constexpr float kMostOfHeld = 1;
inline constexpr float kInertia = 0.5f;  ///< b / (k dt^2) of the added mass beside the stiff spring
/// What stays in a substep of how deep contact began: a bounce of debris takes three substeps, one
/// of a whole block some twenty.
inline constexpr float kBegunStays = 1 - 1 / 128.0f;

/// Of a place that stands for `area` [m^2] of tissue with this P-wave modulus [Pa] and density
/// [kg/m^3], on a lattice of this cell size [m], for substeps of dt [s].
TISSUE_SIM_INLINE SurfaceSpring surface_spring(float modulus, float density, float cell_size,
                                               float area, float dt) {
  const float k = modulus * area / cell_size, along = kAlong * k;
  const float mass = 0.5f * cell_size * density * area;  // of a layer of points
  return {kAcross * k,
          along,
          kDampingAcross * dt * kAcross * k,
          2 * kDampingAlong * sqrtf(along * mass),
          0,
          kUnbounded};
}

/// How often the spring along the surface may be doubled where substeps of dt are shorter than
/// waves need, as in tissue that is squeezed, up to what it is across; `now`: how often it is. A
/// soft one lets what hangs from a tool hang lower. Substeps that go up and down by less than the
/// half do not change it: each time that it gets stiffer what it holds slides a little.
TISSUE_SIM_INLINE int doubled_along(float modulus, float density, float cell_size, float dt,
                                    int now) {
  constexpr int kMost = 4;
  constexpr float kFits = 0.25f, kRoom = 1.25f;
  const float fits = kFits * density * cell_size * cell_size / (modulus * dt * dt);
  while (now > 0 && fits < static_cast<float>(1 << now)) --now;
  while (now < kMost && fits > kRoom * static_cast<float>(2 << now)) ++now;
  return now;
}

/// Doubles the spring along the surface so often.
TISSUE_SIM_INLINE void stiffen_along(SurfaceSpring& s, int doubled) {
  const auto by = static_cast<float>(1 << doubled);
  s.along *= by;
  s.damping_along *= sqrtf(by);
}

/// How much stiffer the spring across the surface is for a tool of this radius [m], if it has one.
TISSUE_SIM_INLINE float stiffer_across(float radius, float cell_size) {
  if (!(radius > 0 && radius < kThinTip * cell_size)) return 1;
  const float cells = fmaxf(radius / cell_size, 0.25f * kThinTip);
  return kAcrossThin / (cells * cells);
}

/// Makes it so much stiffer.
TISSUE_SIM_INLINE void stiffen_across(SurfaceSpring& s, float by) {
  s.across *= by;
  s.damping_across *= by;
}

/// Of a place that stands for so much more.
TISSUE_SIM_INLINE SurfaceSpring scaled(const SurfaceSpring& s, float by) {
  return {by * s.across,        by * s.along,    by * s.damping_across,
          by * s.damping_along, by * s.cohesion, by * s.most};
}

/// Force on the place at x with velocity v, in contact (`g.distance` < 0). `hold` is the place, in
/// the collider's frame, that friction holds on to; it slides with x where the cone is reached.
/// `begun` is how deep it was when contact began, where the spring has no force yet: else each
/// place that comes a part of a substep's way too deep would bring energy with it, debris more than
/// they have. It goes back little by little.
TISSUE_SIM_INLINE void surface_force(const Collider& c, const Gap& g, const SurfaceSpring& spring,
                                     const float* x, const float* v, float* hold, float& begun,
                                     float* force) {
  begun = fminf(kBegunStays * begun, -g.distance);
  float vc[3], held[3], rel[3];
  velocity_at(c, x, vc);
  to_world(c, hold, held);
  float vn = 0, sn = 0;
  for (int i = 0; i < 3; ++i) {
    rel[i] = v[i] - vc[i];
    vn += rel[i] * g.normal[i];
    sn += (x[i] - held[i]) * g.normal[i];
  }
  const float push = fminf(
      fmaxf(0.0f, spring.across * (-g.distance - begun) - spring.damping_across * vn), spring.most);
  float t[3], t2 = 0;
  for (int i = 0; i < 3; ++i) {
    t[i] = -spring.along * (x[i] - held[i] - sn * g.normal[i]) -
           spring.damping_along * (rel[i] - vn * g.normal[i]);
    t2 += t[i] * t[i];
  }
  const float limit = c.friction * push + spring.cohesion;
  if (t2 > limit * limit) {
    const float scale = limit / sqrtf(t2);
    float moved[3];
    for (int i = 0; i < 3; ++i) {
      t[i] *= scale;
      moved[i] = x[i] + t[i] / spring.along;
    }
    to_local(c, moved, hold);
  }
  for (int i = 0; i < 3; ++i) force[i] = push * g.normal[i] + t[i];
}

}  // namespace tissue_sim
