// Sums of what is measured of a block over the threads that measure it. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Of a thread block: a large block of tissue has one multiprocessor to itself.
inline constexpr int kMostThreads = 512;

__device__ __forceinline__ CudaMeasure of_nothing() {
  return {0, 0, {1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, 0, 1, 1, 1, 1};
}

__device__ __forceinline__ void take(CudaMeasure& a, const CudaMeasure& b) {
  a.elastic_energy += b.elastic_energy;
  a.kinetic_energy += b.kinetic_energy;
  for (int i = 0; i < 3; ++i) {
    a.min[i] = fminf(a.min[i], b.min[i]);
    a.max[i] = fmaxf(a.max[i], b.max[i]);
  }
  if (!(b.speed <= a.speed)) a.speed = b.speed;  // NaN stays
  a.stiffening = fmaxf(a.stiffening, b.stiffening);
  a.worst_stiffening = fmaxf(a.worst_stiffening, b.worst_stiffening);
  a.square = fmaxf(a.square, b.square);
  a.finite = a.finite & b.finite;
}

/// Sums, least and largest over the lanes of a warp, in a fixed order, in its first lane.
__device__ __forceinline__ void reduce_warp(CudaMeasure& m) {
  for (int step = 16; step > 0; step /= 2) {
    const auto far = [step](auto value) { return __shfl_down_sync(~0u, value, step); };
    take(m, {far(m.elastic_energy),
             far(m.kinetic_energy),
             {far(m.min[0]), far(m.min[1]), far(m.min[2])},
             {far(m.max[0]), far(m.max[1]), far(m.max[2])},
             far(m.speed),
             far(m.stiffening),
             far(m.worst_stiffening),
             far(m.square),
             far(m.finite)});
  }
}

/// The same over the threads of a block, in its first thread.
__device__ __forceinline__ void reduce(CudaMeasure& m) {
  __shared__ CudaMeasure of_warp[kMostThreads / 32];
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  reduce_warp(m);
  if (lane == 0) of_warp[warp] = m;
  __syncthreads();
  if (warp != 0) return;
  m = lane < static_cast<int>(blockDim.x) / 32 ? of_warp[lane] : of_nothing();
  reduce_warp(m);
}

}  // namespace tissue_sim
