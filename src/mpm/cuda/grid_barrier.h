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

/// Of CudaFrame::arrived, in a round: how many contacts and how many facets somebody has taken.
__device__ __forceinline__ unsigned* turn_counters(unsigned* arrived, int round) {
  return arrived + kFirstTurns + (round % 2) * 2;
}
/// For the round after this one: what they tell is of the last round, whose turns are all over.
__device__ __forceinline__ void clear_next_turns(unsigned* arrived, int round) {
  for (int i = 0; i < 2; ++i) __stcg(turn_counters(arrived, round + 1) + i, 0u);
}

/// What a warp takes of work that is spread over the grid, some pieces at a time: its own turns, or
/// the next ones that nobody has.
class WarpTurns {
 public:
  /// Those of the warps of a team in each of `blocks` thread blocks, of which this is number `rank`
  /// (< 0: none). Different thread blocks come first, then different warps.
  static __device__ __forceinline__ WarpTurns own(int each, int rank, int blocks,
                                                  const Pushers& team) {
    constexpr int kNone = 1 << 30;
    const int warp = team.me() / 32, warps = team.size() / 32;
    return {nullptr, rank < 0 ? kNone : each * (warp * blocks + rank), each * warps * blocks};
  }
  /// Those that a counter, from 0 on, has left: who is free first takes most.
  static __device__ __forceinline__ WarpTurns next_of(unsigned* counter, int each) {
    WarpTurns turns(counter, 0, each);
    turns.first_ = turns.after(0);
    return turns;
  }

  /// The first piece of the first turn.
  __device__ __forceinline__ int first() const { return known(first_); }
  /// Asks for the turn after the one that begins with piece `first`: it is known() later.
  __device__ __forceinline__ int after(int first) const {
    if (counter_ == nullptr) return first + step_;
    return threadIdx.x % 32 == 0 ? static_cast<int>(atomicAdd(counter_, step_)) : 0;
  }
  __device__ __forceinline__ int known(int first) const {
    return counter_ == nullptr ? first : __shfl_sync(0xffffffffu, first, 0);
  }

 private:
  __device__ __forceinline__ WarpTurns(unsigned* counter, int first, int step)
      : counter_(counter), first_(first), step_(step) {}

  unsigned* counter_;
  int first_, step_;
};

}  // namespace tissue_sim
