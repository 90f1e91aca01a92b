// What a place of fluid feels of other fluid and of walls: the kernel, and how much of it a wall
// takes away.
//
// A wall's share of a kernel is the kernel's integral over what is solid. With F(r) the kernel's
// weight beyond r in a unit of solid angle it is the integral of F over the solid angle of all
// triangles of the solid's surface (Feldman and Bonet 2007 integrate so over faces), of those that
// the place is behind with a minus: so what is open again behind an edge, or a wall that is thin,
// is open. Its gradient is the kernel's integral over the triangles. wall_integrals.h has both.
#pragma once

#include <cmath>

#include "compute/choose.h"
#include "compute/host_device.h"

namespace tissue_sim {

namespace fluid {

/// a where v is negative, else b.
template <class V>
TISSUE_SIM_INLINE V where_negative(V v, V a, V b) {
  return choose(less(v, V{}), a, b);
}
template <class V>
TISSUE_SIM_INLINE V lesser(V a, V b) {
  return choose(less(a, b), a, b);
}

}  // namespace fluid

/// Wendland's C2 kernel in three dimensions; t = r / reach, below 1.
struct FluidKernel {
  float reach;  ///< [m]

  static constexpr float kPi = 3.14159265f;

  static constexpr float kSigma = 21 / (2 * kPi);
  /// [1/m^3]
  TISSUE_SIM_INLINE float value(float r) const {
    const float t = r / reach, s = (1 - t) * (1 - t);
    return kSigma / (reach * reach * reach) * s * s * (4 * t + 1);
  }
  /// Slope over r [1/m^5].
  TISSUE_SIM_INLINE float slope_by_r(float r) const {
    const float t = r / reach, u = 1 - t, r2 = reach * reach;
    return -20 * kSigma / (r2 * r2 * reach) * u * u * u;
  }
  /// Integral of value(s) s from r on [1/m].
  TISSUE_SIM_INLINE float value_by_s(float r) const {
    if (r >= reach) return 0;
    const float t = r / reach, t2 = t * t;
    const float from_zero = t2 * (0.5f + t2 * (-2.5f + t * (4 + t * (-2.5f + t * (4.0f / 7)))));
    return kSigma / reach * (1.0f / 14 - from_zero);
  }
};

/// Of a kernel what a wall takes away, and the integral of the kernel over its face [1/m]: how much
/// the share grows as the wall comes nearer.
struct WallShare {
  float share = 0, face = 0;
};

/// Of a plane at this distance; of a place in it, as at it.
TISSUE_SIM_INLINE WallShare plane_share(const FluidKernel& w, float distance) {
  const float d = fmaxf(distance, 0.0f);
  if (d >= w.reach) return {};
  const float t = d / w.reach, t2 = t * t;
  const float poly = 1 - 3 * t + t * t2 * (7 + t2 * (-21 + t * (28 + t * (-15 + 3 * t))));
  return {0.5f * poly, 2 * FluidKernel::kPi * w.value_by_s(d)};
}

TISSUE_SIM_INLINE float dot3(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

TISSUE_SIM_INLINE void cross3(const float* a, const float* b, float* c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

/// A triangle of tissue's surface as a place of fluid meets it: what is seen from afar lies first.
struct alignas(32) WallTriangle {
  float middle[3];     ///< [m]
  float radius;        ///< of the ball about the middle that it is in [m]
  float normal[3];     ///< unit, into the fluid; 0 of a triangle without area
  float area;          ///< [m^2]
  float corner[3][3];  ///< counter-clockwise seen from the fluid [m]
  float edge2;         ///< longest edge, squared [m^2]
  // Numbers in a row, which sums over walls read four at a time.

  /// Nine coordinates.
  TISSUE_SIM_INLINE void place(const float* corners) {
    for (int i = 0; i < 9; ++i) corner[i / 3][i % 3] = corners[i];
    finish();
  }
  TISSUE_SIM_INLINE void finish() {
    float a[3], b[3];
    edge2 = 0;
    for (int k = 0; k < 3; ++k) {
      a[k] = corner[1][k] - corner[0][k];
      b[k] = corner[2][k] - corner[0][k];
      middle[k] = (corner[0][k] + corner[1][k] + corner[2][k]) / 3;
    }
    float radius2 = 0;
    for (int i = 0; i < 3; ++i) {
      float l2 = 0, r2 = 0;
      for (int k = 0; k < 3; ++k) {
        const float e = corner[(i + 1) % 3][k] - corner[i][k], r = corner[i][k] - middle[k];
        l2 += e * e;
        r2 += r * r;
      }
      edge2 = edge2 > l2 ? edge2 : l2;
      radius2 = radius2 > r2 ? radius2 : r2;
    }
    radius = sqrtf(radius2);
    cross3(a, b, normal);
    const float twice = sqrtf(dot3(normal, normal));
    area = 0.5f * twice;
    for (float& n : normal) n = twice > 1e-3f * edge2 * 1e-3f ? n / twice : 0.0f;
  }
  /// No point of it is nearer [m].
  TISSUE_SIM_INLINE float beside(const float* x) const {
    const float d[3] = {x[0] - middle[0], x[1] - middle[1], x[2] - middle[2]};
    return sqrtf(dot3(d, d)) - radius;
  }
  TISSUE_SIM_INLINE float height(const float* x) const {
    const float d[3] = {x[0] - corner[0][0], x[1] - corner[0][1], x[2] - corner[0][2]};
    return dot3(d, normal);
  }
};
static_assert(sizeof(WallTriangle) == 96, "numbers alone");

}  // namespace tissue_sim
