// Barriers of all thread blocks of a cooperative kernel, and of some of their warps. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// A thread block says that it has come to a barrier of the grid, and goes on.
__device__ __forceinline__ void arrive(unsigned* arrived, unsigned thread = 0) {
  __syncthreads();
  if (threadIdx.x == thread) {
    asm volatile("red.release.gpu.global.add.u32 [%0], 1;" ::"l"(arrived) : "memory");
  }
}

/// `count` threads of a thread block from `first` on, whole warps, that meet at barrier kBarrier
/// (from 1 on); or all of them, where `count` is 0.
template <int kBarrier>
struct Team {
  int first = 0, count = 0;

  __device__ __forceinline__ bool is_all() const { return count == 0; }
  __device__ __forceinline__ int size() const {
    return is_all() ? static_cast<int>(blockDim.x) : count;
  }
  /// The calling thread's number in the team: from 0 to size() - 1 where it is one of it.
  __device__ __forceinline__ int me() const { return static_cast<int>(threadIdx.x) - first; }
  __device__ __forceinline__ bool has_me() const { return me() >= 0 && me() < size(); }
  __device__ __forceinline__ void sync() const {
    if (is_all()) {
      __syncthreads();
    } else {
      asm volatile("bar.sync %0, %1;" ::"n"(kBarrier), "r"(count) : "memory");
    }
  }
};
/// Those that work on forces, and those that meanwhile push.
using Workers = Team<1>;
using Pushers = Team<2>;

/// A thread waits until all thread blocks have arrived `round` times.
__device__ __forceinline__ void wait_for(unsigned* arrived, unsigned round) {
  const unsigned wanted = round * gridDim.x;
  unsigned seen;
  do {
    asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(seen) : "l"(arrived) : "memory");
  } while (seen < wanted);
}
/// What thread blocks wrote before they arrived is then seen by all of the team.
template <class TeamOf = Workers>
__device__ __forceinline__ void wait(unsigned* arrived, unsigned round, const TeamOf& team = {}) {
  if (team.me() == 0) wait_for(arrived, round);
  team.sync();
}

/// The same for a warp by itself.
__device__ __forceinline__ void warp_wait(unsigned* arrived, unsigned round) {
  if (threadIdx.x % 32 == 0) wait_for(arrived, round);
  __syncwarp();
}

/// All thread blocks meet; `before_it_ends` is the first thread's of each.
template <class F>
__device__ __forceinline__ void grid_barrier(unsigned* arrived, unsigned round,
                                             const F& before_it_ends) {
  arrive(arrived);
  if (threadIdx.x == 0) {
    wait_for(arrived, round);
    before_it_ends();
  }
  __syncthreads();
}

}  // namespace tissue_sim
