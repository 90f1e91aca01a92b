// How warps share work that is spread over the grid. For .cu files.
#pragma once

#include "mpm/cuda/grid_barrier.h"

namespace tissue_sim {

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
