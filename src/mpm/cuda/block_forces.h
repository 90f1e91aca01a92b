// Force of a block's points on its nodes, and of colliders on its points. For .cu files.
#pragma once

#include "material/laws.h"
#include "mpm/cuda/cell_stabilisation.h"
#include "mpm/cuda/half_cell.h"
#include "mpm/cuda/tool_pushes.h"

namespace tissue_sim {

struct FaceRounds;

/// What a block's threads share, in shared memory.
struct BlockShared {
  float4* u;                  ///< [slots], divided by the cell size
  float4* v;                  ///< [slots], the same; only where contact or viscosity needs it
  float4* exchange;           ///< [1 or 2 planes][plane slots][9]
  unsigned long long* loads;  ///< [kMaxColliders][6]
  Collider* colliders;        ///< [kMaxColliders]
  FaceRounds* rounds;
};

/// What one substep of a bundle needs beside its nodes.
struct BlockStep {
  const HalfPush* pushes;  ///< of colliders, see find_pushes()
  std::uint32_t touched;   ///< the thread's half cells that they push
  float4* force;           ///< of all slots
  bool two_planes;         ///< CudaPlan::two_planes
};

/// Volumes of the points 2 sy + sx of a half cell.
__device__ __forceinline__ float4 half_volumes(const CudaTables& t, const CudaColumn& c,
                                               const CudaBody& body, int z, int sz) {
  if (c.whole != 0) {
    return {body.point_volume, body.point_volume, body.point_volume, body.point_volume};
  }
  const float* v = t.volume + c.lane + (8 * z + 4 * sz) * c.step;
  return {v[0], v[c.step], v[2 * c.step], v[3 * c.step]};
}

/// F to the stress P times -volume / cell size, in place; `damping` is added.
template <class LawOf, bool kViscous>
__device__ __forceinline__ void stress(float mu, float lambda, const float* damping, float* F) {
  float P[9];
  LawOf::stress(F, mu, lambda, P);
#pragma unroll
  for (int i = 0; i < 9; ++i) F[i] = kViscous ? P[i] + damping[i] : P[i];
}

/// Kelvin-Voigt stress at the middle of the cell, from the mean gradients of its two halves, times
/// -1 / cell size and an eighth of the volume of its points. The neighbouring thread has the other
/// half.
__device__ __forceinline__ void viscous_stress(const CudaBody& body, const HalfPlane (&u)[3],
                                               const HalfPlane (&v)[3], float side,
                                               const float4& volume, float (&P)[9]) {
  const unsigned pair = 3u << (threadIdx.x & 30u);
  const auto mean = [pair](float half) { return 0.5f * (half + __shfl_xor_sync(pair, half, 1)); };
  constexpr float k1 = read_scale(1), k2 = read_scale(2) / read_scale(0);
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
  const float half = (volume.x + volume.y) + (volume.z + volume.w);
#pragma unroll
  for (int i = 0; i < 9; ++i) P[i] = 0;
  add_viscous_stress(F, rate, -0.25f * body.inv_cell_size * body.viscosity * mean(half), P);
}

/// Forces of half a cell: reads its nodes, gives its transposed half plane. `stiffness` and `bends`
/// are for kPartial alone: where the cell is not full, -kStabilisation mu V / cell size, else 0.
template <class LawOf, bool kViscous, bool kPartial>
__device__ __forceinline__ void half_forces(const CudaTables& t, const CudaColumn& column,
                                            const CudaBody& body, const BlockShared& s, int z,
                                            int sz, float stiffness, HalfPlane (&out)[3],
                                            HalfBends (&bends)[3]) {
  const int first = column.slot + z * column.plane;
  const float side = sz == 0 ? -1.0f : 1.0f;
  HalfPlane h[3];
  HalfBends bent[3];
  read_half<kPartial>(s.u + first, column.pitch, column.plane, side, h, bent);
  const float4 volume = half_volumes(t, column, body, z, sz);
  float damping[9];
  if (kViscous) {
    HalfPlane rate[3];
    read_half(s.v + first, column.pitch, column.plane, side, rate);
    viscous_stress(body, h, rate, side, volume, damping);
  }
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
  stress<LawOf, kViscous>(mu * volume.x, lambda * volume.x, damping, F[0]);
  stress<LawOf, kViscous>(mu * volume.y, lambda * volume.y, damping, F[1]);
  stress<LawOf, kViscous>(mu * volume.z, lambda * volume.z, damping, F[2]);
  stress<LawOf, kViscous>(mu * volume.w, lambda * volume.w, damping, F[3]);
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    give_stress(F, c, out[c]);
    if (kPartial && stiffness != 0) {
      stabilise_half(stiffness, side, h[c], bent[c], out[c], bends[c]);
    }
  }
}

/// Clears what the columns' threads leave as it is: the parts that a node at the rim of a block
/// gets from columns that are not there.
__device__ __forceinline__ void clear_exchange(float4* exchange, int plane_slots, bool two_planes) {
  const int count = (two_planes ? 18 : 9) * plane_slots;
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    exchange[i] = {0, 0, 0, 0};
  }
}

/// Sums what the cells give to `count` nodes of a plane, in a fixed order, and puts it to `force`.
/// Goes on from `i`, and leaves it at what is left for the next block.
__device__ __forceinline__ void sum_plane(int count, const float4* exchange, float4* force,
                                          int& i) {
  for (; i < count; i += static_cast<int>(blockDim.x)) {
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

/// Adds the plane force of the neighbouring thread, which has the other half of the column's cells.
__device__ __forceinline__ void add_neighbour(PlaneForce& p) {
  constexpr unsigned kAll = 0xffffffffu;
  p.AA += __shfl_xor_sync(kAll, p.AA, 1);
  p.Ad += __shfl_xor_sync(kAll, p.Ad, 1);
  p.AB += __shfl_xor_sync(kAll, p.AB, 1);
  p.dA += __shfl_xor_sync(kAll, p.dA, 1);
  p.dd += __shfl_xor_sync(kAll, p.dd, 1);
  p.dB += __shfl_xor_sync(kAll, p.dB, 1);
  p.BA += __shfl_xor_sync(kAll, p.BA, 1);
  p.Bd += __shfl_xor_sync(kAll, p.Bd, 1);
}

/// nx, ny, nz and first_slot of a block, in one load.
__device__ __forceinline__ int4 block_size(const CudaTables& t, int block) {
  return __ldg(reinterpret_cast<const int4*>(t.blocks + block));
}

/// Forces of a bundle. Two threads, neighbours in a warp, walk up each column of cells: one has the
/// lower, the other the upper halves of the cells, with what these give to the next two node planes
/// in registers. `block` is the bundle's first; contact and bundles of several blocks need
/// kSpecial, cells that are not full kPartial.
template <class LawOf, bool kViscous, bool kSpecial, bool kPartial>
__device__ __forceinline__ void block_forces(const CudaTables& t, const CudaBundle& w,
                                             const CudaBlock& block, const CudaBody& body,
                                             const BlockShared& s, const BlockStep& step) {
  const int thread = static_cast<int>(threadIdx.x), index = thread / 2, sz = thread % 2;
  const int nz = kSpecial ? w.nz : block.nz;
  const int columns = kSpecial ? w.columns : block.nx * block.ny;
  // Threads beyond the last column do what the last one's do, if their warp has to anyway.
  const bool active = index < columns, warp_active = thread / 32 * 16 < columns;
  const CudaColumn column = kSpecial
                                ? column_of(t, w, block, body.cell_size, min(index, columns - 1))
                                : column_of(block, body.cell_size, min(index, columns - 1));
  const int4 first{block.nx, block.ny, block.nz, block.first_slot};

  // Puts what the columns' cells give to plane z together and to the nodes.
  const auto finish_plane = [&](PlaneForce(&now)[3], int z) {
    float4* exchange = s.exchange + (step.two_planes && z % 2 != 0 ? 9 * w.plane_slots : 0);
    if (warp_active) {
      float f[3][3][3];
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        add_neighbour(now[c]);
        if (kPartial) now[c].BB += __shfl_xor_sync(0xffffffffu, now[c].BB, 1);
        node_forces<kPartial>(now[c], f[c]);
      }
      float4* to = exchange + 9 * column.plane_slot;
#pragma unroll
      for (int k = 0; k < 9; ++k) {
        if (!active || (k < 5) != (sz == 0)) continue;  // each of the two writes half of the sums
        const int y = k / 3, x = k % 3;
        to[9 * (y * column.pitch + x) + k] = {f[0][y][x], f[1][y][x], f[2][y][x], 0};
      }
    }
    __syncthreads();
    int i = thread;
    if constexpr (kSpecial) {
      for (int j = 0; j < w.blocks; ++j) {
        const int4 b = j == 0 ? first : block_size(t, w.first_block + j);
        const int plane = (b.x + 2) * (b.y + 2);
        if (z < b.z + 2) sum_plane(plane, exchange, step.force + b.w + z * plane, i);
        exchange += 9 * plane;
      }
    } else {
      sum_plane(column.plane, exchange, step.force + block.first_slot + z * column.plane, i);
    }
    if (!step.two_planes) __syncthreads();
  };

  const GiveWeights k(sz == 0 ? -1.0f : 1.0f);
  constexpr bool kValues = kSpecial || kPartial;
  PlaneForce next[3] = {}, after[3] = {};
#pragma unroll 1
  for (int z = 0; z < nz; ++z) {
    PlaneForce now[3];
    if (warp_active && (!kSpecial || z < column.nz)) {
      HalfPlane out[3];
      HalfBends bends[3];
      float stiffness = 0;
      if (kPartial) {
        stiffness =
            -kStabilisation * body.inv_cell_size * __ldg(t.partial + column.cell + z * column.step);
      }
      half_forces<LawOf, kViscous, kPartial>(t, column, body, s, z, sz, stiffness, out, bends);
      if (kSpecial && (step.touched >> z & 1u) != 0) {
        const HalfPush& push = step.pushes[2 * (z * w.columns + index) + sz];
#pragma unroll
        for (int c = 0; c < 3; ++c) {
          add_forces(*reinterpret_cast<const float4*>(push.of[c]), out[c]);
        }
      }
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        now[c] = plus<kValues>(next[c], out[c], k.below, k.slope_below);
        next[c] = plus<kValues>(after[c], out[c], kAverageCenter, k.slope_center);
        after[c] = plus<kValues>({}, out[c], k.above, k.slope_above);
      }
      if (kPartial && stiffness != 0) {
#pragma unroll
        for (int c = 0; c < 3; ++c) {
          now[c] = plus(now[c], bends[c], k.below, k.slope_below);
          next[c] = plus(next[c], bends[c], kAverageCenter, k.slope_center);
          after[c] = plus(after[c], bends[c], k.above, k.slope_above);
        }
      }
    } else if (kSpecial) {
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        now[c] = next[c];
        next[c] = after[c];
        after[c] = {};
      }
    }
    finish_plane(now, z);
  }
  finish_plane(next, nz);
  finish_plane(after, nz + 1);
}

}  // namespace tissue_sim
