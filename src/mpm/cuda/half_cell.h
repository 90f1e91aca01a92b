// The transfers between half a cell, to which 11 numbers of each component stand for its 27 nodes,
// and its four points, on even and odd parts (math/bspline.h), and the transpose for the forces.
// For .cu files.
//
// All weights are constants, the same for both halves if the planes of nodes are called near and
// far instead of above and below. To save multiplications the numbers are held scaled; what they
// must be multiplied with, read_scale() and give_scale(), is in the constants of the last pass.
#pragma once

#include "material/laws.h"
#include "math/bspline.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Values (w) and slopes along z (s) on the half's plane of points: first letter along x, second
/// along y; A average, d difference, B bend.
struct HalfPlane {
  float wAA, wAd, wAB, wdA, wdd, wdB, wBA, wBd, sAA, sAd, sdA, sdd;
};

/// The rest of the 18 numbers, which only stabilisation needs.
struct HalfBends {
  float wBB, sAB, sdB, sBA, sBd, sBB;
};

/// What displacements of nodes over the cell size are multiplied with where they are put for cells
/// to read: so that the slopes and differences that most of F is need no factor any more.
inline constexpr float kPlacedScale = 0.5f * kAverageCenter * kAverageCenter;
/// The same of displacements in metres.
__device__ __forceinline__ float placed_scale(const CudaBody& body) {
  return kPlacedScale * body.inv_cell_size;
}
/// What a number that was read must be multiplied with, `averages` the letters A in its name.
inline constexpr float read_scale(int averages) {
  return averages == 0 ? kAverageCenter / kPlacedScale : kAverageCenter * read_scale(averages - 1);
}
/// The same of a slope, besides -side / 2.
inline constexpr float slope_scale(int averages) { return read_scale(averages) / kAverageCenter; }
/// What a number that is given back must be multiplied with, of the quantity that x and y (0 A, 1
/// d, 2 B) name; slopes by a quarter of it.
inline constexpr float give_scale(int x, int y) {
  constexpr float kScale[9] = {4.0f, 0.5f, 0.25f, 0.5f, 0.0625f, 0.03125f, 0.25f, 0.03125f, 1.0f};
  return kScale[3 * x + y];
}

__device__ __forceinline__ float component(const float4& v, int c) {
  return c == 0 ? v.x : c == 1 ? v.y : v.z;
}

/// Average, over kAverageCenter, of three values with this sum of the outer ones.
__device__ __forceinline__ float average(float sum, float center) {
  return center + kAverageSide / kAverageCenter * sum;
}

/// Pass along z: what is read of a value and of a slope on the half's plane of points.
__device__ __forceinline__ float half_value(float far, float center, float near) {
  return (kAverageSide + 0.125f) / kAverageCenter * near +
         ((kAverageSide - 0.125f) / kAverageCenter * far + center);
}
__device__ __forceinline__ float half_slope(float far, float center, float near) {
  return 0.5f * far + (center - 1.5f * near);
}

/// Reads the 27 nodes of a cell, of which `node` is the lowest; `side` is -1 for the lower half, +1
/// for the upper; `bends` with kBends alone.
template <bool kBends>
__device__ __forceinline__ void read_half(const float4* node, int pitch, int plane, float side,
                                          HalfPlane (&h)[3], HalfBends (&bends)[3]) {
  const float4 *far = side > 0 ? node : node + 2 * plane,
               *near = side > 0 ? node + 2 * plane : node;
  float A[3][3], d[3][3], B[3][3], sA[3][3], sd[3][3], sB[3][3];
#pragma unroll
  for (int y = 0; y < 3; ++y) {
    float w[3][3], s[3][3];
#pragma unroll
    for (int x = 0; x < 3; ++x) {
      const int i = y * pitch + x;
      const float4 at_far = far[i], at = node[plane + i], at_near = near[i];
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        const float f = component(at_far, c), o = component(at, c), n = component(at_near, c);
        w[c][x] = half_value(f, o, n);
        s[c][x] = half_slope(f, o, n);
      }
    }
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const float sum = w[c][2] + w[c][0], s_sum = s[c][2] + s[c][0];
      A[c][y] = average(sum, w[c][1]);
      d[c][y] = w[c][2] - w[c][0];
      B[c][y] = sum - 2.0f * w[c][1];
      sA[c][y] = average(s_sum, s[c][1]);
      sd[c][y] = s[c][2] - s[c][0];
      if (kBends) sB[c][y] = s_sum - 2.0f * s[c][1];
    }
  }
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    float sum = A[c][2] + A[c][0];
    h[c].wAA = average(sum, A[c][1]);
    h[c].wAd = A[c][2] - A[c][0];
    h[c].wAB = sum - 2.0f * A[c][1];
    sum = d[c][2] + d[c][0];
    h[c].wdA = average(sum, d[c][1]);
    h[c].wdd = d[c][2] - d[c][0];
    h[c].wdB = sum - 2.0f * d[c][1];
    sum = B[c][2] + B[c][0];
    h[c].wBA = average(sum, B[c][1]);
    h[c].wBd = B[c][2] - B[c][0];
    if (kBends) bends[c].wBB = sum - 2.0f * B[c][1];
    sum = sA[c][2] + sA[c][0];
    h[c].sAA = average(sum, sA[c][1]);
    h[c].sAd = sA[c][2] - sA[c][0];
    if (kBends) bends[c].sAB = sum - 2.0f * sA[c][1];
    sum = sd[c][2] + sd[c][0];
    h[c].sdA = average(sum, sd[c][1]);
    h[c].sdd = sd[c][2] - sd[c][0];
    if (!kBends) continue;
    bends[c].sdB = sum - 2.0f * sd[c][1];
    sum = sB[c][2] + sB[c][0];
    bends[c].sBA = average(sum, sB[c][1]);
    bends[c].sBd = sB[c][2] - sB[c][0];
    bends[c].sBB = sum - 2.0f * sB[c][1];
  }
}
__device__ __forceinline__ void read_half(const float4* node, int pitch, int plane, float side,
                                          HalfPlane (&h)[3]) {
  HalfBends none[3];
  read_half<false>(node, pitch, plane, side, h, none);
}

/// Row c of the deformation gradient F at the two points of the row at y = `y` (-1 or 1) of the
/// half at z = `side`, from component c. `y` and `c` are best known to the compiler. The 1 comes
/// last, for small motions not to be rounded more than once at its size.
__device__ __forceinline__ void row_of_F(const HalfPlane& h, int c, float side, float y,
                                         float (&low)[3], float (&high)[3]) {
  constexpr float k0 = read_scale(0), k1 = read_scale(1);
  // (wdA/2 + y wdd/16) + x/4 (wBA + y wBd/8)
  const float xd = 0.5f * k1 * h.wdA + 0.0625f * k0 * y * h.wdd,
              xb = h.wBA + 0.125f * k0 / k1 * y * h.wBd;
  low[0] = xd - 0.25f * k1 * xb;
  high[0] = xd + 0.25f * k1 * xb;
  // (wAd/2 + y wAB/4) + x/8 (wdd/2 + y wdB/4)
  const float ya = 0.5f * k1 * h.wAd + 0.25f * k1 * y * h.wAB, yd = h.wdd + 0.5f * y * h.wdB;
  low[1] = ya - 0.0625f * k0 * yd;
  high[1] = ya + 0.0625f * k0 * yd;
  // (sAA + y sAd/8) + x/8 (sdA + y sdd/8)
  constexpr float k = 0.125f * slope_scale(0) / slope_scale(1);
  const float s1 = -0.5f * slope_scale(2) * side, s0 = -0.0625f * slope_scale(1) * side;
  const float za = s1 * h.sAA + s0 * (y * h.sAd), zd = h.sdA + k * y * h.sdd;
  low[2] = za - s0 * zd;
  high[2] = za + s0 * zd;
  low[c] += 1.0f;
  high[c] += 1.0f;
}

/// Value of one component at the point with sides x and y.
__device__ __forceinline__ float point_value(const HalfPlane& h, float x, float y) {
  constexpr float k0 = read_scale(0), k1 = read_scale(1), k2 = read_scale(2);
  return k2 * h.wAA + 0.125f * (y * (k1 * h.wAd) + x * (k1 * h.wdA + 0.125f * k0 * (y * h.wdd)));
}

/// Transpose of row_of_F() for all points of the half: gives back row c of their stress, P[point].
__device__ __forceinline__ void give_stress(const float (&P)[4][9], int c, HalfPlane& h) {
  const float *p0 = P[0] + 3 * c, *p1 = P[1] + 3 * c, *p2 = P[2] + 3 * c, *p3 = P[3] + 3 * c;
  const float xs0 = p1[0] + p0[0], xs1 = p3[0] + p2[0], xd0 = p1[0] - p0[0], xd1 = p3[0] - p2[0];
  const float ys0 = p1[1] + p0[1], ys1 = p3[1] + p2[1], yd0 = p1[1] - p0[1], yd1 = p3[1] - p2[1];
  const float zs0 = p1[2] + p0[2], zs1 = p3[2] + p2[2], zd0 = p1[2] - p0[2], zd1 = p3[2] - p2[2];
  h.wAA = 0;
  h.wAd = ys1 + ys0;
  h.wAB = ys1 - ys0;
  h.wdA = xs1 + xs0;
  h.wdd = (xs1 - xs0) + (yd1 + yd0);
  h.wdB = yd1 - yd0;
  h.wBA = xd1 + xd0;
  h.wBd = xd1 - xd0;
  h.sAA = zs1 + zs0;
  h.sAd = zs1 - zs0;
  h.sdA = zd1 + zd0;
  h.sdd = zd1 - zd0;
}

// Stress of the points of half a cell and what it gives back. For .cu files.

/// Volumes of the points 2 sy + sx of a half cell.
__device__ __forceinline__ float4 half_volumes(const CudaTables& t, const CudaColumn& c,
                                               const CudaBody& body, int z, int sz) {
  if (c.whole != 0) {
    return {body.point_volume, body.point_volume, body.point_volume, body.point_volume};
  }
  const float* v = t.volume + c.lane + (8 * z + 4 * sz) * c.step;
  return {v[0], v[c.step], v[2 * c.step], v[3 * c.step]};
}

/// F of kTogether points, worked on side by side for none to wait for its own roots, to the stress
/// P times -volume / cell size, in place; `damping` is added.
template <class LawOf, bool kViscous, int kTogether>
__device__ __forceinline__ void stresses(const float* mu, const float* lambda, const float* damping,
                                         float (*F)[9]) {
  float P[kTogether][9];
  LawOf::template stresses<kTogether>(F, mu, lambda, P);
#pragma unroll
  for (int k = 0; k < kTogether; ++k) {
#pragma unroll
    for (int i = 0; i < 9; ++i) F[k][i] = kViscous ? P[k][i] + damping[i] : P[k][i];
  }
}

/// Kelvin-Voigt stress at the middle of the cell, from the mean gradients of its two halves, times
/// -1 / cell size, an eighth of the volume of its points and the share of the cell that they fill.
/// The neighbouring thread has the other half.
__device__ __forceinline__ void viscous_stress(const CudaBody& body, const HalfPlane (&u)[3],
                                               const HalfPlane (&v)[3], float side,
                                               const float4& volume, float (&P)[9]) {
  const unsigned pair = 3u << (threadIdx.x & 30u);
  const auto mean = [pair](float half) { return 0.5f * (half + __shfl_xor_sync(pair, half, 1)); };
  constexpr float k1 = read_scale(1), k2 = slope_scale(2);
  float F[9], rate[9];
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    F[3 * c] = mean(0.5f * k1 * u[c].wdA);
    F[3 * c + 1] = mean(0.5f * k1 * u[c].wAd);
    F[3 * c + 2] = mean(-0.5f * k2 * side * u[c].sAA);
    rate[3 * c] = mean(0.5f * k1 * v[c].wdA);
    rate[3 * c + 1] = mean(0.5f * k1 * v[c].wAd);
    rate[3 * c + 2] = mean(-0.5f * k2 * side * v[c].sAA);
    F[4 * c] += 1.0f;
  }
  const float half = mean((volume.x + volume.y) + (volume.z + volume.w));
  const float filled = 2 * half * body.inv_cell_size * body.inv_cell_size * body.inv_cell_size;
#pragma unroll
  for (int i = 0; i < 9; ++i) P[i] = 0;
  add_viscous_stress(F, rate, -0.25f * body.inv_cell_size * body.viscosity * half * filled, P);
}

/// From half a cell's numbers to what its stress gives back, for points of these volumes, none
/// of which is 0 in a `whole` column.
template <class LawOf, bool kViscous, int kTogether>
__device__ __forceinline__ void half_forces(const CudaBody& body, const HalfPlane (&h)[3],
                                            float side, const float4& volume, bool whole,
                                            const float* damping, HalfPlane (&out)[3]) {
  float F[4][9];
#pragma unroll
  for (int c = 0; c < 3; ++c) {
#pragma unroll
    for (int ty = 0; ty < 2; ++ty) {
      float low[3], high[3];
      row_of_F(h[c], c, side, ty == 0 ? -1.0f : 1.0f, low, high);
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        F[2 * ty][3 * c + i] = low[i];
        F[2 * ty + 1][3 * c + i] = high[i];
      }
    }
  }
  const float mu = -body.inv_cell_size * body.mu, lambda = -body.inv_cell_size * body.lambda;
  const float m[4] = {mu * volume.x, mu * volume.y, mu * volume.z, mu * volume.w};
  const float l[4] = {lambda * volume.x, lambda * volume.y, lambda * volume.z, lambda * volume.w};
  if (whole || (volume.x + volume.y) + (volume.z + volume.w) != 0) {
#pragma unroll
    for (int k = 0; k < 4; k += kTogether) {
      stresses<LawOf, kViscous, kTogether>(m + k, l + k, damping, F + k);
    }
  } else {
    // Nodes may be of pieces far apart, and of how far a law may make what is no number: times a
    // volume of 0 it stays none.
#pragma unroll
    for (int k = 0; k < 4; ++k) {
#pragma unroll
      for (int i = 0; i < 9; ++i) F[k][i] = kViscous ? damping[i] : 0;
    }
  }
#pragma unroll
  for (int c = 0; c < 3; ++c) give_stress(F, c, out[c]);
}

}  // namespace tissue_sim
