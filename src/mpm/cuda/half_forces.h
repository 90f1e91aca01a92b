// Stress of the points of half a cell and what it gives back. For .cu files.
#pragma once

#include "material/laws.h"
#include "mpm/cuda/half_cell.h"

namespace tissue_sim {

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
