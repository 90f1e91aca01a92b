// Stabilisation of one cell that is not full (mpm/blocks/stabilisation.h). For .cu files.
#pragma once

#include <utility>

#include "mpm/cuda/node_plane.h"

namespace tissue_sim {

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
