// Barriers of all thread blocks of a cooperative kernel. For .cu files.
#pragma once

namespace tissue_sim {

/// A thread block says that it has come to a barrier of the grid, and goes on.
__device__ __forceinline__ void arrive(unsigned* arrived, unsigned thread = 0) {
  __syncthreads();
  if (threadIdx.x == thread) {
    asm volatile("red.release.gpu.global.add.u32 [%0], 1;" ::"l"(arrived) : "memory");
  }
}

/// Waits until all thread blocks have arrived `round` times; what they wrote before is then seen by
/// all.
__device__ __forceinline__ void wait(unsigned* arrived, unsigned round) {
  if (threadIdx.x == 0) {
    const unsigned wanted = round * gridDim.x;
    unsigned seen;
    do {
      asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(seen) : "l"(arrived) : "memory");
    } while (seen < wanted);
  }
  __syncthreads();
}

__device__ __forceinline__ void grid_barrier(unsigned* arrived, unsigned round) {
  arrive(arrived);
  wait(arrived, round);
}

}  // namespace tissue_sim
