// The transfers between a cell's three planes of nodes and what stands for them in its halves, and
// the transpose for the forces. For .cu files.
#pragma once

#include <utility>

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

// Stabilisation of one cell that is not full (mpm/blocks/stabilisation.h). For .cu files.

/// Twice the energy, over stiffness and cell size squared, of one x-y quantity on three planes.
template <int kQuantity>
__device__ __forceinline__ float number_energy2(const float (&q)[3][kXyCount]) {
  constexpr float kA = stabilisation::weight2(kQuantity, 0),
                  kD = stabilisation::weight2(kQuantity, 1),
                  kB = stabilisation::weight2(kQuantity, 2);
  const Line<float> l(q[0][kQuantity], q[1][kQuantity], q[2][kQuantity]);
  return kA * l.A * l.A + kD * l.d * l.d + kB * l.B * l.B;
}
template <int... kQuantities>
__device__ __forceinline__ float numbers_energy2(std::integer_sequence<int, kQuantities...>,
                                                 const float (&q)[3][kXyCount]) {
  return (number_energy2<kQuantities>(q) + ...);
}

/// Twice the energy of what stabilises component c in a cell. `node` is the lowest of its 27, times
/// kPlacedScale, `stiffness` kStabilisation mu V.
__device__ inline float stabilising_energy2(const float4* node, int pitch, int plane, int c,
                                            float stiffness) {
  float q[3][kXyCount];
#pragma unroll
  for (int z = 0; z < 3; ++z) {
    float A[3], d[3], B[3];
#pragma unroll
    for (int y = 0; y < 3; ++y) {
      const float4* p = node + z * plane + y * pitch;
      const Line<float> l(component(p[0], c), component(p[1], c), component(p[2], c));
      A[y] = l.A;
      d[y] = l.d;
      B[y] = l.B;
    }
    const Line<float> a(A[0], A[1], A[2]), b(d[0], d[1], d[2]), e(B[0], B[1], B[2]);
    q[z][kAA] = a.A, q[z][kAd] = a.d, q[z][kAB] = a.B;
    q[z][kdA] = b.A, q[z][kdd] = b.d, q[z][kdB] = b.B;
    q[z][kBA] = e.A, q[z][kBd] = e.d, q[z][kBB] = e.B;
  }
  constexpr float kScale = 1 / (kPlacedScale * kPlacedScale);
  return kScale * stiffness * numbers_energy2(std::make_integer_sequence<int, kXyCount>(), q);
}

/// Adds what one x-y quantity's value `w` and slope `s` on the half's plane of points give back to
/// them. The neighbouring thread has the other half: along z, w+ and w- are A +- d/8, s+ and s- d/2
/// +- B/4.
template <int kQuantity>
__device__ __forceinline__ void stabilise_number(float stiffness, float side, float w, float s,
                                                 float& to_w, float& to_s) {
  constexpr int kX = stabilisation::kKinds[kQuantity][0], kY = stabilisation::kKinds[kQuantity][1];
  constexpr int kAverages = (kX == 0 ? 1 : 0) + (kY == 0 ? 1 : 0);
  constexpr float kRead = read_scale(kAverages), kSlope = slope_scale(kAverages),
                  kGive = give_scale(kX, kY);
  constexpr float kA = 0.25f * stabilisation::weight2(kQuantity, 0),
                  kD = 16.0f * stabilisation::weight2(kQuantity, 1),
                  kB = 4.0f * stabilisation::weight2(kQuantity, 2);
  const unsigned pair = 3u << (threadIdx.x & 30u);
  // Slopes were read by -side / 2, and the other half's side is the other one.
  const float other_s = __shfl_xor_sync(pair, s, 1);
  to_s += stiffness * side * (-2.0f * kB * kSlope / kGive) * (s + other_s);
  if (kA + kD == 0) return;
  const float other_w = __shfl_xor_sync(pair, w, 1);
  to_w += stiffness * (kRead / kGive) * ((kA + kD) * w + (kA - kD) * other_w);
}

/// What stabilises the cell, of the half that the thread has; the neighbouring thread does the
/// other. `stiffness` is -kStabilisation mu V / cell size. Adds to `out`, sets `bends_out`.
__device__ __forceinline__ void stabilise_half(float stiffness, float side, const HalfPlane& h,
                                               const HalfBends& b, HalfPlane& out,
                                               HalfBends& bends_out) {
  bends_out = {};
  stabilise_number<kAA>(stiffness, side, h.wAA, h.sAA, out.wAA, out.sAA);
  stabilise_number<kAd>(stiffness, side, h.wAd, h.sAd, out.wAd, out.sAd);
  stabilise_number<kdA>(stiffness, side, h.wdA, h.sdA, out.wdA, out.sdA);
  stabilise_number<kdd>(stiffness, side, h.wdd, h.sdd, out.wdd, out.sdd);
  stabilise_number<kAB>(stiffness, side, h.wAB, b.sAB, out.wAB, bends_out.sAB);
  stabilise_number<kdB>(stiffness, side, h.wdB, b.sdB, out.wdB, bends_out.sdB);
  stabilise_number<kBA>(stiffness, side, h.wBA, b.sBA, out.wBA, bends_out.sBA);
  stabilise_number<kBd>(stiffness, side, h.wBd, b.sBd, out.wBd, bends_out.sBd);
  stabilise_number<kBB>(stiffness, side, b.wBB, b.sBB, bends_out.wBB, bends_out.sBB);
}

/// Adds what stabilises one x-y quantity to what its three planes get: the pass along z, the
/// weights and the pass back in one.
template <int kQuantity>
__device__ __forceinline__ void stabilise_planes(float stiffness, const PlaneNumbers& below,
                                                 const PlaneNumbers& center,
                                                 const PlaneNumbers& above, PlaneNumbers& to_below,
                                                 PlaneNumbers& to_center, PlaneNumbers& to_above) {
  constexpr int kX = stabilisation::kKinds[kQuantity][0], kY = stabilisation::kKinds[kQuantity][1];
  constexpr float kScale = slope_scale((kX == 0 ? 1 : 0) + (kY == 0 ? 1 : 0)) / give_scale(kX, kY) *
                           kNodeScale<kQuantity>;
  constexpr float kA = kScale * stabilisation::weight2(kQuantity, 0),
                  kD = kScale * stabilisation::weight2(kQuantity, 1),
                  kB = kScale * stabilisation::weight2(kQuantity, 2);
  const float sum = above[kQuantity] + below[kQuantity], middle = center[kQuantity];
  float to_middle, to_side;
  if (kA == 0) {  // exactly nothing for tissue that moved far
    to_side = kB * (sum - 2.0f * middle);
    to_middle = -2.0f * to_side;
  } else {
    constexpr float kBoth = kAverageSide * kAverageCenter * kA - 2 * kB;
    to_side = (kAverageSide * kAverageSide * kA + kB) * sum + kBoth * middle;
    to_middle = kBoth * sum + (kAverageCenter * kAverageCenter * kA + 4 * kB) * middle;
  }
  const float slope = kD == 0 ? 0 : kD * (above[kQuantity] - below[kQuantity]);
  to_below[kQuantity] += stiffness * (to_side - slope);
  to_center[kQuantity] += stiffness * to_middle;
  to_above[kQuantity] += stiffness * (to_side + slope);
}
template <int... kQuantities>
__device__ __forceinline__ void stabilise_cell(std::integer_sequence<int, kQuantities...>,
                                               float stiffness, const PlaneNumbers& below,
                                               const PlaneNumbers& center,
                                               const PlaneNumbers& above, PlaneNumbers& to_below,
                                               PlaneNumbers& to_center, PlaneNumbers& to_above) {
  (stabilise_planes<kQuantities>(stiffness, below, center, above, to_below, to_center, to_above),
   ...);
}

}  // namespace tissue_sim
