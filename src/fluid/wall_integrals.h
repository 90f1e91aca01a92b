// What a triangle of a wall takes of the kernel of a place of fluid (fluid_laws.h), for V = float
// (GPU) or vectors of triangles (CPU).
#pragma once

#include "fluid/fluid_laws.h"

namespace tissue_sim {
namespace fluid {

/// Of the reach: a triangle with longer edges is summed in parts; at most so many along an edge.
inline constexpr float kPart = 0.75f;
inline constexpr int kMostParts = 8;
/// Radii of a triangle: from there on its middle stands for it, the share within 0.001.
inline constexpr float kFar = 4;

/// Along an edge of this length squared [m^2].
TISSUE_SIM_INLINE int parts_of(float edge2, float reach) {
  const int parts = static_cast<int>(ceilf(sqrtf(edge2) / (kPart * reach)));
  return parts < 1 ? 1 : (parts > kMostParts ? kMostParts : parts);
}

/// Places of a triangle by two of their coordinates, three in each of its `n` times `n` parts: they
/// integrate squares exactly.
class TrianglePlaces {
 public:
  TISSUE_SIM_HOST_DEVICE constexpr explicit TrianglePlaces(int n) : n_(n) {}
  TISSUE_SIM_HOST_DEVICE constexpr bool done() const { return i_ == n_; }
  TISSUE_SIM_HOST_DEVICE constexpr void next() {
    if (++c_ < 3) return;
    c_ = 0;
    if (++down_ < (i_ + j_ + 1 < n_ ? 2 : 1)) return;
    down_ = 0;
    if (i_ + ++j_ < n_) return;
    j_ = 0;
    ++i_;
  }
  TISSUE_SIM_HOST_DEVICE constexpr float a() const {
    const float u = c_ == 1 ? 2.0f / 3 : 1.0f / 6;
    return (i_ + (down_ == 0 ? u : 1 - u)) / n_;
  }
  TISSUE_SIM_HOST_DEVICE constexpr float b() const {
    const float v = c_ == 2 ? 2.0f / 3 : 1.0f / 6;
    return (j_ + (down_ == 0 ? v : 1 - v)) / n_;
  }

 private:
  int n_, i_ = 0, j_ = 0, down_ = 0, c_ = 0;
};

/// atan2, within 1e-7 (the polynomial: Abramowitz and Stegun 4.4.49).
template <class V>
TISSUE_SIM_INLINE V angle(V y, V x) {
  constexpr float kPi = FluidKernel::kPi;
  const V ax = where_negative(x, -x, x), ay = where_negative(y, -y, y), lower = ax - ay;
  const V t = lesser(ax, ay) / (larger(ax, ay) + 1e-30f), s = t * t;
  V p = 0.0028662257f * s - 0.0161657367f;
  p = p * s + 0.0429096138f;
  p = p * s - 0.0752896400f;
  p = p * s + 0.1065626393f;
  p = p * s - 0.1420889944f;
  p = p * s + 0.1999355085f;
  p = p * s - 0.3333314528f;
  p = t + t * (s * p);
  p = where_negative(lower, kPi / 2 - p, p);
  p = where_negative(x, kPi - p, p);
  return where_negative(y, -p, p);
}

template <class V>
TISSUE_SIM_INLINE V dot(const V* a, const V* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The solid angle is exact; what the kernel has within the triangle, which is smooth, and the
/// kernel itself are summed over places.
template <class V>
struct CloseTriangle {
  V c[3][3];  ///< corners from the place [m]
  V n[3], area, height, by_reach, from[3], to[3], within, face;

  TISSUE_SIM_INLINE void begin(const V* normal, V area_of, float reach) {
    area = area_of;
    by_reach = all_lanes<V>(1 / reach);
    within = face = V{};
    for (int a = 0; a < 3; ++a) {
      n[a] = normal[a];
      from[a] = c[1][a] - c[0][a];
      to[a] = c[2][a] - c[0][a];
    }
    height = -dot(c[0], n);
  }
  TISSUE_SIM_INLINE void add_place(float a, float b) {
    const V one = all_lanes<V>(1);
    V at[3];
    for (int k = 0; k < 3; ++k) at[k] = c[0][k] + a * from[k] + b * to[k];
    const V t = square_root(dot(at, at)) * by_reach, t2 = t * t, u = one - t;
    const V inside = 14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t)));
    within += where_negative(u, one / (t2 * t + 1e-30f), inside);
    const V near = where_negative(u, V{}, u), u2 = near * near;
    face += u2 * u2 * (4 * t + one);
  }
  /// Twice the area along the normal makes the volume that the corners span with the place. What
  /// has no normal has no angle.
  TISSUE_SIM_INLINE V angle_share() const {
    V r[3];
    for (int k = 0; k < 3; ++k) r[k] = square_root(dot(c[k], c[k]));
    const V half = angle(2 * area * height, r[0] * r[1] * r[2] + dot(c[0], c[1]) * r[2] +
                                                dot(c[1], c[2]) * r[0] + dot(c[2], c[0]) * r[1]);
    return where_negative(dot(n, n) - 0.5f, V{}, half) * (1 / (2 * FluidKernel::kPi));
  }
  TISSUE_SIM_INLINE V kernel_share(int places, float reach) const {
    const float by_places = 1.0f / static_cast<float>(places);
    return area * height * within * (by_places / (4 * FluidKernel::kPi * reach * reach * reach));
  }
  /// The kernel's integral over it [1/m].
  TISSUE_SIM_INLINE V over(int places, const FluidKernel& kernel) const {
    const float by_places = 1.0f / static_cast<float>(places);
    return area * face * (by_places * kernel.value(0));
  }
};

/// A triangle that its middle stands for, `x` from the place [m].
template <class V>
struct FarTriangle {
  V share, over;

  TISSUE_SIM_INLINE FarTriangle(const V* x, const V* n, V area, const FluidKernel& kernel) {
    const V one = all_lanes<V>(1), r = square_root(dot(x, x));
    const V t = lesser(r * all_lanes<V>(1 / kernel.reach), one);
    const V t2 = t * t, u2 = (one - t) * (one - t);
    const V beyond = one - t2 * t * (14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t))));
    share = area * beyond * dot(x, n) / (r * r * r + 1e-30f) * (-1 / (4 * FluidKernel::kPi));
    over = area * (u2 * u2 * (4 * t + one)) * kernel.value(0);
  }
};

}  // namespace fluid
}  // namespace tissue_sim
