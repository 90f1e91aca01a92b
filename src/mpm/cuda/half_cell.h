// The transfers of half a cell, between its 27 nodes and four of its points: along z first, then x
// and y, on even and odd parts (math/bspline.h), and the transpose for the forces. For .cu files.
//
// A thread has half a cell in registers: 10 numbers of each component stand for the nodes, and all
// weights are constants but those along z, which depend on the half.
#pragma once

#include "math/bspline.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Weights along z of the nodes below, at and above the cell, of the points of one half.
struct HalfWeights {
  float below, above;                            // of values; kAverageCenter at the cell
  float slope_below, slope_center, slope_above;  // of slopes

  /// `side` is -1 for the lower half, +1 for the upper.
  __device__ __forceinline__ explicit HalfWeights(float side)
      : below(kAverageSide - 0.125f * side),
        above(kAverageSide + 0.125f * side),
        slope_below(0.25f * side - 0.5f),
        slope_center(-0.5f * side),
        slope_above(0.25f * side + 0.5f) {}
};

/// Values (w) and slopes along z (s) on the half's plane of points: first letter along x, second
/// along y; A average, d difference, B bend.
struct HalfPlane {
  float wAA, wAd, wAB, wdA, wdd, wdB, wBA, wBd, sAA, sAd, sdA, sdd;
};

/// The rest of the 18 numbers, which only stabilisation needs.
struct HalfBends {
  float wBB, sAB, sdB, sBA, sBd, sBB;
};

__device__ __forceinline__ float component(const float4& v, int c) {
  return c == 0 ? v.x : c == 1 ? v.y : v.z;
}

/// Reads the 27 nodes of a cell, of which `node` is the lowest; `bends` with kBends alone.
template <bool kBends>
__device__ __forceinline__ void read_half(const float4* node, int pitch, int plane,
                                          const HalfWeights& k, HalfPlane (&h)[3],
                                          HalfBends (&bends)[3]) {
  float A[3][3], d[3][3], B[3][3], sA[3][3], sd[3][3], sB[3][3];
#pragma unroll
  for (int y = 0; y < 3; ++y) {
    float w[3][3], s[3][3];
#pragma unroll
    for (int x = 0; x < 3; ++x) {
      const float4* p = node + y * pitch + x;
      const float4 below = p[0], center = p[plane], above = p[2 * plane];
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        const float m = component(below, c), o = component(center, c), a = component(above, c);
        w[c][x] = k.below * m + (kAverageCenter * o + k.above * a);
        s[c][x] = k.slope_below * m + (k.slope_center * o + k.slope_above * a);
      }
    }
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const float sum = w[c][2] + w[c][0];
      A[c][y] = kAverageSide * sum + kAverageCenter * w[c][1];
      d[c][y] = w[c][2] - w[c][0];
      B[c][y] = sum - 2.0f * w[c][1];
      sA[c][y] = kAverageSide * (s[c][2] + s[c][0]) + kAverageCenter * s[c][1];
      sd[c][y] = s[c][2] - s[c][0];
      if (kBends) sB[c][y] = s[c][2] + s[c][0] - 2.0f * s[c][1];
    }
  }
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    float sum = A[c][2] + A[c][0];
    h[c].wAA = kAverageSide * sum + kAverageCenter * A[c][1];
    h[c].wAd = A[c][2] - A[c][0];
    h[c].wAB = sum - 2.0f * A[c][1];
    sum = d[c][2] + d[c][0];
    h[c].wdA = kAverageSide * sum + kAverageCenter * d[c][1];
    h[c].wdd = d[c][2] - d[c][0];
    h[c].wdB = sum - 2.0f * d[c][1];
    h[c].wBA = kAverageSide * (B[c][2] + B[c][0]) + kAverageCenter * B[c][1];
    h[c].wBd = B[c][2] - B[c][0];
    h[c].sAA = kAverageSide * (sA[c][2] + sA[c][0]) + kAverageCenter * sA[c][1];
    h[c].sAd = sA[c][2] - sA[c][0];
    h[c].sdA = kAverageSide * (sd[c][2] + sd[c][0]) + kAverageCenter * sd[c][1];
    h[c].sdd = sd[c][2] - sd[c][0];
    if (!kBends) continue;
    bends[c].wBB = B[c][2] + B[c][0] - 2.0f * B[c][1];
    bends[c].sAB = sA[c][2] + sA[c][0] - 2.0f * sA[c][1];
    bends[c].sdB = sd[c][2] + sd[c][0] - 2.0f * sd[c][1];
    sum = sB[c][2] + sB[c][0];
    bends[c].sBA = kAverageSide * sum + kAverageCenter * sB[c][1];
    bends[c].sBd = sB[c][2] - sB[c][0];
    bends[c].sBB = sum - 2.0f * sB[c][1];
  }
}
__device__ __forceinline__ void read_half(const float4* node, int pitch, int plane,
                                          const HalfWeights& k, HalfPlane (&h)[3]) {
  HalfBends none[3];
  read_half<false>(node, pitch, plane, k, h, none);
}

/// Gradients of one component at the two points of the row at y = `side`, times the cell size.
__device__ __forceinline__ void row_gradient(const HalfPlane& h, float side, float (&low)[3],
                                             float (&high)[3]) {
  const float e = 0.125f * side, q = 0.25f * side;
  const float xd = 0.5f * (h.wdA + e * h.wdd), xb = h.wBA + e * h.wBd;
  low[0] = xd - 0.25f * xb;
  high[0] = xd + 0.25f * xb;
  // Along y: (Ad/2 + q AB) + x/8 (dd/2 + q dB); along z: (AA + e Ad) + x/8 (dA + e dd).
  const float ya = 0.5f * h.wAd + q * h.wAB, yd = 0.5f * h.wdd + q * h.wdB;
  low[1] = ya - 0.125f * yd;
  high[1] = ya + 0.125f * yd;
  const float za = h.sAA + e * h.sAd, zd = h.sdA + e * h.sdd;
  low[2] = za - 0.125f * zd;
  high[2] = za + 0.125f * zd;
}

/// Value of one component at the point with sides x and y.
__device__ __forceinline__ float point_value(const HalfPlane& h, float x, float y) {
  return h.wAA + 0.125f * (y * h.wAd + x * (h.wdA + 0.125f * y * h.wdd));
}

/// Transpose of row_gradient(): adds the two points' stress to `h`.
__device__ __forceinline__ void add_row_stress(const float (&low)[3], const float (&high)[3],
                                               float side, HalfPlane& h) {
  const float e = 0.125f * side, q = 0.25f * side;
  const float xs = 0.5f * (high[0] + low[0]), xb = 0.25f * (high[0] - low[0]);
  h.wdA += xs;
  h.wdd += e * xs;
  h.wBA += xb;
  h.wBd += e * xb;
  const float ys = high[1] + low[1], yd = 0.125f * (high[1] - low[1]);
  h.wAd += 0.5f * ys;
  h.wAB += q * ys;
  h.wdd += 0.5f * yd;
  h.wdB += q * yd;
  const float zs = high[2] + low[2], zd = 0.125f * (high[2] - low[2]);
  h.sAA += zs;
  h.sAd += e * zs;
  h.sdA += zd;
  h.sdd += e * zd;
}

/// Transpose of point_value().
__device__ __forceinline__ void add_point_force(float f, float x, float y, HalfPlane& h) {
  h.wAA += f;
  h.wAd += 0.125f * y * f;
  h.wdA += 0.125f * x * f;
  h.wdd += 0.015625f * x * y * f;
}

/// What a cell gives to one node plane, before x and y are undone.
struct PlaneForce {
  float AA, Ad, AB, dA, dd, dB, BA, Bd, BB;  // BB by stabilisation alone
};

/// Transpose of the pass along z: adds to the plane that has these weights.
__device__ __forceinline__ void add_to_plane(const HalfPlane& h, float w, float s, PlaneForce& p) {
  p.AA += w * h.wAA + s * h.sAA;
  p.Ad += w * h.wAd + s * h.sAd;
  p.AB += w * h.wAB;
  p.dA += w * h.wdA + s * h.sdA;
  p.dd += w * h.wdd + s * h.sdd;
  p.dB += w * h.wdB;
  p.BA += w * h.wBA;
  p.Bd += w * h.wBd;
}
__device__ __forceinline__ void add_to_plane(const HalfBends& h, float w, float s, PlaneForce& p) {
  p.AB += s * h.sAB;
  p.dB += s * h.sdB;
  p.BA += s * h.sBA;
  p.Bd += s * h.sBd;
  p.BB += w * h.wBB + s * h.sBB;
}

/// Transpose of the passes along x and y: the force on the 3 x 3 nodes of a plane, f[y][x].
template <bool kBendBend>
__device__ __forceinline__ void node_forces(const PlaneForce& p, float (&f)[3][3]) {
  const float a = kAverageSide * p.AA + p.AB, d = kAverageSide * p.dA + p.dB;
  const float rA[3] = {a - p.Ad, kAverageCenter * p.AA - 2.0f * p.AB, a + p.Ad};
  const float rd[3] = {d - p.dd, kAverageCenter * p.dA - 2.0f * p.dB, d + p.dd};
  float rB[3] = {kAverageSide * p.BA - p.Bd, kAverageCenter * p.BA, kAverageSide * p.BA + p.Bd};
  if (kBendBend) {
    rB[0] += p.BB;
    rB[1] -= 2.0f * p.BB;
    rB[2] += p.BB;
  }
#pragma unroll
  for (int y = 0; y < 3; ++y) {
    const float sum = kAverageSide * rA[y] + rB[y];
    f[y][0] = sum - rd[y];
    f[y][1] = kAverageCenter * rA[y] - 2.0f * rB[y];
    f[y][2] = sum + rd[y];
  }
}

}  // namespace tissue_sim
