// Forces of a block whose nodes come plane by plane. For .cu files.
#pragma once

#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/moving_planes.h"
#include "mpm/cuda/plane_barrier.h"

namespace tissue_sim {

/// What block_forces() does for a block of full cells alone in its bundle, and the nodes' motion
/// before it; planes.expect() was called. What cells give to a plane is summed up between the two
/// halves of the next cells: then all have arrived at the barrier between long ago, and nobody
/// waits.
template <class LawOf, class Known>
__device__ __forceinline__ void march(const CudaTables& t, const CudaBlock& block,
                                      const CudaBody& body, const BlockShared& s, int round,
                                      float4* force, MovingPlanes<Known> planes, const Known& known,
                                      PlaneBarrier& barrier) {
  const int thread = static_cast<int>(threadIdx.x), threads = known.threads;
  const int columns = known.nx * known.ny;
  const bool active = Known::kKnown || thread < columns, warp_active = thread / 32 * 32 < columns;
  ColumnWalk<LawOf, false, false, false, 2> walk{t, body, s};
  walk.column = column_of(block, min(thread, columns - 1));
  if (Known::kKnown) {
    walk.column.whole = 1;
    walk.column.pitch = known.nx + 2;
    walk.column.plane = known.room;
    walk.column.plane_slot = thread + 2 * (thread / known.nx);
  }
  const int plane_slots = walk.column.plane;
  const auto exchange = [&](int z) { return s.exchange + (z & 1) * 9 * plane_slots; };
  // As moves, sums begin with another thread in each plane.
  int begin = thread;
  const int turn_by = 96 % threads;
  const auto sum = [&](int z) {
    int i = begin;
    begin += turn_by;
    if (begin >= threads) begin -= threads;
    sum_plane(plane_slots, exchange(z), force + block.first_slot + z * plane_slots, threads, i);
  };

  planes.begin(round);
  if (warp_active) walk.begin(planes.of(walk.column, 0), planes.of(walk.column, 1));
  barrier.arrive();
#pragma unroll 1
  for (int z = 0; z < block.nz; ++z) {
    const auto between = [&] {
      barrier.wait();
      if (z > 0) sum(z - 1);
    };
    if (warp_active) {
      walk.cell(z, planes.of(walk.column, z + 2), between);
      walk.give(walk.now, exchange(z), active);
    } else {
      between();
    }
    planes.next(z + kPlanesInPlace);
    barrier.arrive();
  }
  const auto finish = [&](PlaneNumbers(&plane)[3], int z) {
    barrier.wait();
    sum(z - 1);
    if (warp_active) walk.give(plane, exchange(z), active);
    barrier.arrive();
  };
  finish(walk.next, block.nz);
  finish(walk.after, block.nz + 1);
  barrier.wait();
  sum(block.nz + 1);
}

}  // namespace tissue_sim
