// The transfers between a cell's three planes of nodes and what stands for them in its halves, and
// the transpose for the forces. For .cu files.
#pragma once

#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/half_cell.h"

namespace tissue_sim {

/// What one component at the 3 x 3 nodes of a plane is to a cell, or what they get from it, by
/// XyQuantity; BB for stabilisation alone. Read, each is divided by kAverageCenter for each of its
/// letters A; given back, by give_scale().
struct PlaneNumbers {
  float of[kXyCount];
  __device__ __forceinline__ float& operator[](int i) { return of[i]; }
  __device__ __forceinline__ float operator[](int i) const { return of[i]; }
};

/// Passes along x and y of the plane of which `node` is the lowest of 3 x 3; BB with kBends alone.
template <bool kBends>
__device__ __forceinline__ void read_plane(const float4* node, int pitch, PlaneNumbers (&p)[3]) {
  float A[3][3], d[3][3], B[3][3];
#pragma unroll
  for (int y = 0; y < 3; ++y) {
    const float4 u[3] = {node[y * pitch], node[y * pitch + 1], node[y * pitch + 2]};
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const float low = component(u[0], c), mid = component(u[1], c), high = component(u[2], c);
      const float sum = high + low;
      A[c][y] = average(sum, mid);
      d[c][y] = high - low;
      B[c][y] = sum - 2.0f * mid;
    }
  }
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    float sum = A[c][2] + A[c][0];
    p[c][kAA] = average(sum, A[c][1]);
    p[c][kAd] = A[c][2] - A[c][0];
    p[c][kAB] = sum - 2.0f * A[c][1];
    sum = d[c][2] + d[c][0];
    p[c][kdA] = average(sum, d[c][1]);
    p[c][kdd] = d[c][2] - d[c][0];
    p[c][kdB] = sum - 2.0f * d[c][1];
    sum = B[c][2] + B[c][0];
    p[c][kBA] = average(sum, B[c][1]);
    p[c][kBd] = B[c][2] - B[c][0];
    if (kBends) p[c][kBB] = sum - 2.0f * B[c][1];
  }
}

/// Pass along z for the half on the side of the plane `near`; the same numbers as read_half()
/// gives, but for wAA, which stress does not need.
__device__ __forceinline__ void half_between(const PlaneNumbers& far, const PlaneNumbers& center,
                                             const PlaneNumbers& near, HalfPlane& h) {
  const auto w = [&](int i) { return half_value(far[i], center[i], near[i]); };
  const auto s = [&](int i) { return half_slope(far[i], center[i], near[i]); };
  h.wAd = w(kAd);
  h.wAB = w(kAB);
  h.wdA = w(kdA);
  h.wdd = w(kdd);
  h.wdB = w(kdB);
  h.wBA = w(kBA);
  h.wBd = w(kBd);
  h.sAA = s(kAA);
  h.sAd = s(kAd);
  h.sdA = s(kdA);
  h.sdd = s(kdd);
}

/// Weights of the nodes below, at and above the cell for what a half gives back: of values
/// (kAverageCenter at the cell) and a quarter of those of slopes.
struct GiveWeights {
  float below, above;
  float slope_below, slope_center, slope_above;

  __device__ __forceinline__ explicit GiveWeights(float side)
      : below(kAverageSide - 0.125f * side),
        above(kAverageSide + 0.125f * side),
        slope_below(0.0625f * side - 0.125f),
        slope_center(-0.125f * side),
        slope_above(0.0625f * side + 0.125f) {}
};

/// What a quantity that was given back must be multiplied with for node_forces(); 1 without kApply.
template <int kQuantity, bool kApply = true>
inline constexpr float kNodeScale =
    !kApply
        ? 1.0f
        : (stabilisation::kKinds[kQuantity][0] == 0 ? kAverageCenter : 1) *
              (stabilisation::kKinds[kQuantity][1] == 0 ? kAverageCenter : 1) *
              give_scale(stabilisation::kKinds[kQuantity][0], stabilisation::kKinds[kQuantity][1]);

/// Transpose of the pass along z: `p` and what the plane that has these weights gets from a half;
/// with kValues from wAA too, which stress gives nothing to; with kScaled times kNodeScale, which
/// costs nothing where the compiler knows the weights.
template <bool kValues, bool kScaled>
__device__ __forceinline__ PlaneNumbers plus(const PlaneNumbers& p, const HalfPlane& h, float w,
                                             float s) {
  PlaneNumbers q;
  q[kAA] = p[kAA] + kNodeScale<kAA, kScaled> * s * h.sAA;
  if (kValues) q[kAA] += kNodeScale<kAA, kScaled> * w * h.wAA;
  q[kAd] = p[kAd] + kNodeScale<kAd, kScaled> * w * h.wAd + kNodeScale<kAd, kScaled> * s * h.sAd;
  q[kAB] = p[kAB] + kNodeScale<kAB, kScaled> * w * h.wAB;
  q[kdA] = p[kdA] + kNodeScale<kdA, kScaled> * w * h.wdA + kNodeScale<kdA, kScaled> * s * h.sdA;
  q[kdd] = p[kdd] + kNodeScale<kdd, kScaled> * w * h.wdd + kNodeScale<kdd, kScaled> * s * h.sdd;
  q[kdB] = p[kdB] + kNodeScale<kdB, kScaled> * w * h.wdB;
  q[kBA] = p[kBA] + kNodeScale<kBA, kScaled> * w * h.wBA;
  q[kBd] = p[kBd] + kNodeScale<kBd, kScaled> * w * h.wBd;
  q[kBB] = p[kBB];
  return q;
}
__device__ __forceinline__ PlaneNumbers plus(const PlaneNumbers& p, const HalfBends& h, float w,
                                             float s) {
  PlaneNumbers q = p;
  q[kAB] += s * h.sAB;
  q[kdB] += s * h.sdB;
  q[kBA] += s * h.sBA;
  q[kBd] += s * h.sBd;
  q[kBB] = p[kBB] + w * h.wBB + s * h.sBB;
  return q;
}

/// Transpose of the passes along x and y: the force on the 3 x 3 nodes of a plane, f[y][x].
/// kScaled: kNodeScale is in `p`.
template <bool kBendBend, bool kScaled>
__device__ __forceinline__ void node_forces(const PlaneNumbers& p, float (&f)[3][3]) {
  constexpr float kSide = kAverageSide / kAverageCenter;
  constexpr bool k = !kScaled;
  const float AA = kNodeScale<kAA, k> * p[kAA], A = fmaf(kSide, AA, kNodeScale<kAB, k> * p[kAB]);
  const float rA[3] = {fmaf(-kNodeScale<kAd, k>, p[kAd], A),
                       fmaf(-2.0f * kNodeScale<kAB, k>, p[kAB], AA),
                       fmaf(kNodeScale<kAd, k>, p[kAd], A)};
  const float dA = kNodeScale<kdA, k> * p[kdA], d = fmaf(kSide, dA, kNodeScale<kdB, k> * p[kdB]);
  const float rd[3] = {fmaf(-kNodeScale<kdd, k>, p[kdd], d),
                       fmaf(-2.0f * kNodeScale<kdB, k>, p[kdB], dA),
                       fmaf(kNodeScale<kdd, k>, p[kdd], d)};
  const float BA = kNodeScale<kBA, k> * p[kBA];
  float B = kSide * BA;
  if (kBendBend) B = fmaf(kNodeScale<kBB, k>, p[kBB], B);
  float rB[3] = {fmaf(-kNodeScale<kBd, k>, p[kBd], B), BA, fmaf(kNodeScale<kBd, k>, p[kBd], B)};
  if (kBendBend) rB[1] = fmaf(-2.0f * kNodeScale<kBB, k>, p[kBB], BA);
#pragma unroll
  for (int y = 0; y < 3; ++y) {
    const float sides = kSide * rA[y] + rB[y];
    f[y][0] = sides - rd[y];
    f[y][1] = rA[y] - 2.0f * rB[y];
    f[y][2] = sides + rd[y];
  }
}

}  // namespace tissue_sim
