// Force of a block's points on its nodes. For .cu files.
#pragma once

#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/grid_barrier.h"
#include "mpm/cuda/half_cell.h"
#include "mpm/cuda/node_plane.h"

namespace tissue_sim {

struct FaceRounds;
struct WarpNodes;

/// What a block's threads share, in shared memory.
struct BlockShared {
  float4* u;            ///< [slots], divided by the cell size
  float4* v;            ///< [slots], the same; only where viscosity needs it
  float4* exchange;     ///< [1 or 2 planes][plane slots][9]
  Collider* colliders;  ///< [kMaxColliders]
  FaceRounds* rounds;
  WarpNodes* cells;  ///< one a warp
};

/// What one substep of a bundle needs beside its nodes.
struct BlockStep {
  float4* force;    ///< of all slots
  bool two_planes;  ///< CudaPlan::two_planes
  Workers workers;
};

/// A column of a bundle and the thread that walks up it, alone or, with kPairs, with its neighbour
/// in the warp: one has the lower, the other the upper halves of the cells. It works on the
/// stresses of kTogether points side by side.
template <class LawOf, bool kViscous, bool kPartial, bool kPairs, int kTogether = 1>
struct ColumnWalk {
  const CudaTables& t;
  const CudaBody& body;
  const BlockShared& s;
  CudaColumn column;
  PlaneNumbers center[3], below[3];  ///< of u, of the next cell's planes; not kPairs
  PlaneNumbers now[3], next[3] = {}, after[3] = {};  ///< what planes of nodes get

  __device__ __forceinline__ static int index_of(int thread) {
    return kPairs ? thread / 2 : thread;
  }

  /// -kStabilisation mu V / cell size where the cell is not full, else 0.
  __device__ __forceinline__ float stiffness(int z) const {
    return -kStabilisation * body.inv_cell_size * __ldg(t.partial + column.cell + z * column.step);
  }

  /// The thread's half of cell z.
  __device__ __forceinline__ void half(int z) {
    const int sz = static_cast<int>(threadIdx.x) % 2;
    const float side = sz == 0 ? -1.0f : 1.0f;
    const int first = column.slot + z * column.plane;
    HalfPlane h[3], out[3];
    HalfBends bent[3];
    // From memory: on their way while the nodes are read.
    const float4 volume = half_volumes(t, column, body, z, sz);
    const float extra = kPartial ? stiffness(z) : 0;
    read_half<kPartial>(s.u + first, column.pitch, column.plane, side, h, bent);
    float damping[9];
    if (kViscous) {
      HalfPlane rate[3];
      read_half(s.v + first, column.pitch, column.plane, side, rate);
      viscous_stress(body, h, rate, side, volume, damping);
    }
    half_forces<LawOf, kViscous, kTogether>(body, h, side, volume, column.whole != 0, damping, out);
    const GiveWeights k(side);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      HalfBends bends;
      if (kPartial && extra != 0) stabilise_half(extra, side, h[c], bent[c], out[c], bends);
      now[c] = plus<kPartial, !kPairs>(next[c], out[c], k.below, k.slope_below);
      next[c] = plus<kPartial, !kPairs>(after[c], out[c], kAverageCenter, k.slope_center);
      after[c] = plus<kPartial, !kPairs>({}, out[c], k.above, k.slope_above);
      if (!kPartial || extra == 0) continue;
      now[c] = plus(now[c], bends, k.below, k.slope_below);
      next[c] = plus(next[c], bends, kAverageCenter, k.slope_center);
      after[c] = plus(after[c], bends, k.above, k.slope_above);
    }
  }

  /// Begins with the column's nodes of the lowest two planes.
  __device__ __forceinline__ void begin(const float4* lowest, const float4* second) {
    if (kPairs) return;
    read_plane<kPartial>(lowest, column.pitch, below);
    read_plane<kPartial>(second, column.pitch, center);
  }
  /// All of cell z, with the column's nodes of the plane above.
  __device__ __forceinline__ void cell(int z, const float4* nodes) {
    const float extra = kPartial ? stiffness(z) : 0;  // from memory: on its way
    PlaneNumbers above[3];
    read_plane<kPartial>(nodes, column.pitch, above);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      now[c] = next[c];
      next[c] = after[c];
      after[c] = {};
    }
#pragma unroll
    for (int sz = 0; sz < 2; ++sz) {
      const float side = sz == 0 ? -1.0f : 1.0f;
      HalfPlane h[3], out[3];
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        half_between(sz == 0 ? above[c] : below[c], center[c], sz == 0 ? below[c] : above[c], h[c]);
      }
      half_forces<LawOf, false, kTogether>(body, h, side, half_volumes(t, column, body, z, sz),
                                           column.whole != 0, nullptr, out);
      const GiveWeights k(side);
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        now[c] = plus<kPartial, !kPairs>(now[c], out[c], k.below, k.slope_below);
        next[c] = plus<kPartial, !kPairs>(next[c], out[c], kAverageCenter, k.slope_center);
        after[c] = plus<kPartial, !kPairs>(after[c], out[c], k.above, k.slope_above);
      }
    }
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      if (kPartial && extra != 0) {
        stabilise_cell(std::make_integer_sequence<int, kXyCount>(), extra, below[c], center[c],
                       above[c], now[c], next[c], after[c]);
      }
      below[c] = center[c];
      center[c] = above[c];
    }
  }
  /// What comes after the column's last cell.
  __device__ __forceinline__ void rise() {
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      now[c] = next[c];
      next[c] = after[c];
      after[c] = {};
    }
  }

  /// Puts the column's part of the plane's forces to the exchange, if `mine`.
  __device__ __forceinline__ void give(PlaneNumbers (&plane)[3], float4* exchange, bool mine) {
    const int sz = static_cast<int>(threadIdx.x) % 2;
    float f[3][3][3];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      if (kPairs) {
#pragma unroll
        for (int i = 0; i < (kPartial ? kXyCount : kStressXyCount); ++i) {
          plane[c][i] += __shfl_xor_sync(0xffffffffu, plane[c][i], 1);
        }
      }
      node_forces<kPartial, !kPairs>(plane[c], f[c]);
    }
    float4* to = exchange + 9 * column.plane_slot;
#pragma unroll
    for (int k = 0; k < 9; ++k) {
      // Each of two writes half of the sums.
      if (!mine || (kPairs && (k < 5) != (sz == 0))) continue;
      const int y = k / 3, x = k % 3;
      to[9 * (y * column.pitch + x) + k] = {f[0][y][x], f[1][y][x], f[2][y][x], 0};
    }
  }
};

/// Clears what the columns' threads leave as it is: the parts that a node at the rim of a block
/// gets from columns that are not there.
__device__ __forceinline__ void clear_exchange(float4* exchange, int plane_slots, bool two_planes) {
  const int count = (two_planes ? 18 : 9) * plane_slots;
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    exchange[i] = {0, 0, 0, 0};
  }
}

/// Sums what the cells give to `count` nodes of a plane, in a fixed order, and puts it to `force`.
/// Goes on from `i`, in steps of as many as there are threads, and leaves it at what is left for
/// the next block.
__device__ __forceinline__ void sum_plane(int count, const float4* exchange, float4* force,
                                          int threads, int& i) {
#pragma unroll 1
  for (; i < count; i += threads) {
    float4 f[9];
#pragma unroll
    for (int k = 0; k < 9; ++k) f[k] = exchange[9 * i + k];
#pragma unroll
    for (int step = 1; step < 9; step *= 2) {
#pragma unroll
      for (int k = 0; k + step < 9; k += 2 * step) add(f[k + step], f[k]);
    }
    __stcg(force + i, f[0]);
  }
  i -= count;
}

/// nx, ny, nz and first_slot of a block, in one load.
__device__ __forceinline__ int4 block_size(const CudaTables& t, int block) {
  return __ldg(reinterpret_cast<const int4*>(t.blocks + block));
}

/// Forces of a bundle. Each column of cells has a thread, or two, that walks up it with what the
/// cells give to the next two node planes in registers. `block` is the bundle's first; bundles
/// of several blocks need kSpecial, cells that are not full kPartial.
template <class LawOf, bool kViscous, bool kSpecial, bool kPartial, bool kPairs>
__device__ __forceinline__ void block_forces(const CudaTables& t, const CudaBundle& w,
                                             const CudaBlock& block, const CudaBody& body,
                                             const BlockShared& s, const BlockStep& step) {
  // All others wait for the special ones; two points at once there take a fortieth off them.
  constexpr int kTogether = kSpecial && !kPairs ? 2 : 1;
  using Walk = ColumnWalk<LawOf, kViscous, kPartial, kPairs, kTogether>;
  const int thread = static_cast<int>(threadIdx.x), threads = step.workers.size();
  const int index = Walk::index_of(thread);
  const int nz = kSpecial ? w.nz : block.nz;
  const int columns = kSpecial ? w.columns : block.nx * block.ny;
  // Threads beyond the last column do what the last one's do, if their warp has to anyway.
  const bool active = index < columns, warp_active = Walk::index_of(thread / 32 * 32) < columns;
  const int4 first{block.nx, block.ny, block.nz, block.first_slot};
  const int column = max(0, min(index, columns - 1));
  Walk walk{t, body, s};
  walk.column = kSpecial ? column_of(t, w, block, column) : column_of(block, column);

  // Puts what the columns' cells give to plane z together and to the nodes.
  const auto finish_plane = [&](PlaneNumbers(&plane)[3], int z) {
    float4* exchange = s.exchange + (step.two_planes && z % 2 != 0 ? 9 * w.plane_slots : 0);
    if (warp_active) walk.give(plane, exchange, active);
    step.workers.sync();
    int i = thread;
    if constexpr (kSpecial) {
      for (int j = 0; j < w.blocks; ++j) {
        const int4 b = j == 0 ? first : block_size(t, w.first_block + j);
        const int slots = (b.x + 2) * (b.y + 2);
        if (z < b.z + 2) sum_plane(slots, exchange, step.force + b.w + z * slots, threads, i);
        exchange += 9 * slots;
      }
    } else {
      const int slots = walk.column.plane;
      sum_plane(slots, exchange, step.force + block.first_slot + z * slots, threads, i);
    }
    if (!step.two_planes) step.workers.sync();
  };

  const float4* nodes = s.u + walk.column.slot;
  if (warp_active) walk.begin(nodes, nodes + walk.column.plane);
#pragma unroll 1
  for (int z = 0; z < nz; ++z) {
    if (warp_active && (!kSpecial || z < walk.column.nz)) {
      if (kPairs) {
        walk.half(z);
      } else {
        walk.cell(z, nodes + (z + 2) * walk.column.plane);
      }
    } else if (kSpecial) {
      walk.rise();
    }
    finish_plane(walk.now, z);
  }
  finish_plane(walk.next, nz);
  finish_plane(walk.after, nz + 1);
}

}  // namespace tissue_sim
