// What the kernels of the search have in common. For .cu files.
#pragma once

#include "compute/cuda_check.h"
#include "mpm/cuda/block_nodes.h"

namespace tissue_sim {

inline constexpr int kThreads = 128;

inline int blocks_for(int n) { return (n + kThreads - 1) / kThreads; }

__device__ __forceinline__ int thread_index() {
  return static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
}

/// Sum over the lanes up to this one.
__device__ __forceinline__ int sum_up_to(int value, int lane) {
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    const int before = __shfl_up_sync(0xffffffffu, value, step);
    if (lane >= step) value += before;
  }
  return value;
}

/// Largest over a warp and all warps.
__device__ __forceinline__ void take_largest(unsigned value, unsigned* largest) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) {
    value = max(value, __shfl_xor_sync(0xffffffffu, value, step));
  }
  if (threadIdx.x % 32 == 0 && value > 0) atomicMax(largest, value);
}

__device__ __forceinline__ float speed_of(const CudaLooks& s, int f) {
  const double* mean = s.figures->mean_velocity;
  const float* v = s.motion[f].v;
  const double x = v[0] - mean[0], y = v[1] - mean[1], z = v[2] - mean[2];
  return static_cast<float>(sqrt(x * x + y * y + z * z));
}

__device__ __forceinline__ bool out_of_control(const CudaLooks& s) {
  return !(__uint_as_float(s.figures->fastest) < kOutOfControl);
}
__device__ __forceinline__ double horizon_of(const CudaLooks& s) {
  return search_horizon(__uint_as_float(s.figures->fastest), s.cell_size);
}
/// How far a facet gets until the next search [m].
__device__ __forceinline__ float travel_of(const CudaLooks& s, int f) {
  return speed_of(s, f) * static_cast<float>(kForesight * horizon_of(s));
}

/// Whether lists are to be made.
__device__ __forceinline__ bool lists_wanted(const CudaLooks& s) {
  return s.figures->listed_anew != 0 && !out_of_control(s);
}

inline void check_launch() { check_cuda(cudaGetLastError(), "start a kernel"); }

}  // namespace tissue_sim
