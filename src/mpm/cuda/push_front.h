// What the front's cells push within a substep. For .cu files.
//
// They are no work of the blocks that they are in, for these would keep all others waiting: as with
// cells near colliders, a warp of any thread block that is free takes the next pass of one, once
// all nodes are in place, and adds its forces to the sums that contact adds to.
#pragma once

#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/front_warp.h"
#include "mpm/cuda/grid_barrier.h"

namespace tissue_sim {

/// Of CudaFrame::arrived: how many cells somebody has taken in a round.
__device__ __forceinline__ unsigned* front_turns(unsigned* arrived, int round) {
  return arrived + kFirstFrontTurns + round % 2;
}

/// Moves parted nodes on at the beginning of a round, before thread blocks say that their nodes are
/// in place: those without a bundle do it where there are any.
__device__ __forceinline__ void move_parted(const CudaFrame& f, int bundles, int round,
                                            const PushedNodes& pushed) {
  const int all = static_cast<int>(gridDim.x), first = all > bundles ? bundles : 0;
  const int block = static_cast<int>(blockIdx.x) - first, blocks = all - first;
  if (block < 0 || round == 0) return;
  const bool odd = ((f.current + round) & 1) != 0;
  const CudaNodes &from = odd ? f.state[0] : f.state[1], &to = odd ? f.state[1] : f.state[0];
  const int step = blocks * static_cast<int>(blockDim.x);
  for (int i = block + blocks * static_cast<int>(threadIdx.x); i < f.front.node_count; i += step) {
    const int n = f.front.first_node + i;
    float4 u = __ldcg(from.u + n), v = __ldcg(from.v + n);
    const Pushed push(pushed, true, true, n);
    const float kick_over_m = f.step.kick * v.w, keep = f.step.keep, dt = f.step.dt;
    v.x = keep * v.x + kick_over_m * push.of(0);
    v.y = keep * v.y + kick_over_m * push.of(1);
    v.z = keep * v.z + kick_over_m * push.of(2);
    u.x += dt * v.x;
    u.y += dt * v.y;
    u.z += dt * v.z;
    __stcg(to.u + n, u);
    __stcg(to.v + n, v);
  }
}

/// Works out passes of cells: the warp's own first (`own`, of `owned`, where warps have one each),
/// then those that no warp has. Out of line, for the blocks to keep their registers.
inline __device__ __noinline__ void push_front(const CudaFront front, const CudaNodes state,
                                               unsigned* arrived, int round, unsigned own,
                                               unsigned owned, long long* sums) {
  const auto tasks = static_cast<unsigned>(front.task_count);
  unsigned* counter = front_turns(arrived, round);
  bool waited = false;
  for (unsigned i = own;;) {
    if (FrontWarp::any(i >= owned)) {
      if (owned >= tasks) return;
      i = tasks;
      if (threadIdx.x % 32 == 0 && owned + __ldcg(counter) < tasks) {
        i = owned + atomicAdd(counter, 1u);
      }
      i = __shfl_sync(0xffffffffu, i, 0);
    }
    if (!FrontWarp::any(i < tasks)) return;
    const int4 task = __ldg(front.tasks + i);
    FrontWarp cell(front, task.x, task.z, task.w);
    if (!waited) warp_wait(arrived + 1, static_cast<unsigned>(round) + 1);
    waited = true;
    cell.bring(state);
    if (FrontWarp::any(task.y == kStabilises)) {
      cell.stabilise<true>(sums);
    } else if (FrontWarp::any(cell.cell.law == Law::kNeoHookean)) {
      cell.push<NeoHookean>(task.y, sums);
    } else {
      cell.push<FixedCorotated>(task.y, sums);
    }
    i = owned;
  }
}

}  // namespace tissue_sim
