// What a place of fluid feels of other fluid and of walls: the kernel, and how much of it a wall
// takes away.
//
// A wall's share of a kernel is exact for what the fluid sees of it: all that lies behind a
// triangle along a ray from the place counts as wall. With F(r) the kernel's weight beyond r in a
// unit of solid angle, the share is the integral of F over the solid angle of each triangle
// (Feldman and Bonet 2007 integrate so over faces), and its gradient that of the kernel over the
// triangle.
#pragma once

#include <cmath>

#include "compute/host_device.h"

namespace tissue_sim {

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
  /// Weight in a unit of solid angle beyond r [1].
  TISSUE_SIM_INLINE float beyond(float r) const {
    const float t = r / reach, t3 = t * t * t;
    return (1 - t3 * (14 + t * t * (-84 + t * (140 + t * (-90 + 21 * t))))) / (4 * kPi);
  }
  /// Integral of beyond(s) / s^2 from r on [1/m].
  TISSUE_SIM_INLINE float beyond_by_r2(float r) const {
    if (r >= reach) return 0;
    const float t = r / reach, t2 = t * t;
    return (1 / t + t2 * (7 + t2 * (-21 + t * (28 + t * (-15 + 3 * t)))) - 3) / (4 * kPi * reach);
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

/// A triangle of tissue's surface as a place of fluid meets it.
struct WallTriangle {
  float corner[3][3];  ///< counter-clockwise seen from the fluid [m]
  float normal[3];     ///< unit, into the fluid; 0 of a triangle without area
  float area;          ///< [m^2]
  float middle[3];     ///< [m]
  float edge2;         ///< longest edge, squared [m^2]

  TISSUE_SIM_INLINE void finish() {
    float a[3], b[3];
    edge2 = 0;
    for (int k = 0; k < 3; ++k) {
      a[k] = corner[1][k] - corner[0][k];
      b[k] = corner[2][k] - corner[0][k];
      middle[k] = (corner[0][k] + corner[1][k] + corner[2][k]) / 3;
    }
    for (int i = 0; i < 3; ++i) {
      float l2 = 0;
      for (int k = 0; k < 3; ++k) {
        const float e = corner[(i + 1) % 3][k] - corner[i][k];
        l2 += e * e;
      }
      edge2 = fmaxf(edge2, l2);
    }
    cross3(a, b, normal);
    const float twice = sqrtf(dot3(normal, normal));
    area = 0.5f * twice;
    for (float& n : normal) n = twice > 1e-3f * edge2 * 1e-3f ? n / twice : 0.0f;
  }
  TISSUE_SIM_INLINE float height(const float* x) const {
    const float d[3] = {x[0] - corner[0][0], x[1] - corner[0][1], x[2] - corner[0][2]};
    return dot3(d, normal);
  }
};

/// Of one edge of a triangle, seen from the foot of the place on its plane: the integral over the
/// angle that it fills of what lies between foot and edge.
TISSUE_SIM_INLINE void add_edge(const FluidKernel& w, float distance, const float* from,
                                const float* to, const float* normal, WallShare& sum) {
  const float e[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  const float length = sqrtf(dot3(e, e));
  float c[3];
  cross3(from, to, c);
  if (!(length > 0)) return;
  const float h = dot3(c, normal) / length;  // of the edge's line, from the foot
  if (fabsf(h) < 1e-6f * length) return;
  const float begin = atanf(dot3(from, e) / (length * h)), end = atanf(dot3(to, e) / (length * h));
  constexpr float kAt[2] = {0.861136312f, 0.339981044f}, kWeight[2] = {0.347854845f, 0.652145155f};
  const float middle = 0.5f * (begin + end), half = 0.5f * (end - begin);
  const float at_foot = distance * w.beyond_by_r2(distance), face = w.value_by_s(distance);
  for (int i = 0; i < 4; ++i) {
    const float angle = middle + (i % 2 == 0 ? -half : half) * kAt[i / 2];
    const float along = h / cosf(angle), r = sqrtf(distance * distance + along * along);
    const float weight = half * kWeight[i / 2];
    sum.share += weight * (at_foot - distance * w.beyond_by_r2(r));
    sum.face += weight * (face - w.value_by_s(r));
  }
}

/// Of a triangle that faces the place x; nothing of one that does not.
TISSUE_SIM_INLINE WallShare triangle_share(const FluidKernel& w, const WallTriangle& t,
                                           const float* x) {
  constexpr float kFar2 = 0.8f * 0.8f;  // edges; from there on one place stands for the triangle
  const float d[3] = {x[0] - t.middle[0], x[1] - t.middle[1], x[2] - t.middle[2]};
  const float height = dot3(d, t.normal), r2 = dot3(d, d);
  if (!(height > 0) || height >= w.reach) return {};
  if (r2 > kFar2 * t.edge2) {
    const float r = sqrtf(r2);
    if (r >= w.reach) return {};
    return {t.area * w.beyond(r) * height / (r2 * r), t.area * w.value(r)};
  }
  float corner[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) corner[i][k] = t.corner[i][k] - x[k] + height * t.normal[k];
  }
  const float near = fmaxf(height, 1e-4f * w.reach);
  WallShare sum;
  for (int i = 0; i < 3; ++i) add_edge(w, near, corner[i], corner[(i + 1) % 3], t.normal, sum);
  return {fmaxf(sum.share, 0.0f), fmaxf(sum.face, 0.0f)};
}

}  // namespace tissue_sim
