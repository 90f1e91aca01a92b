// Which points of a bundle colliders touch. For .cu files.
//
// Few points are near a tool, but all of a tool's lie in few blocks, and the slowest block decides
// how long a substep takes. So all threads look for them together: first for the cells near a
// collider, then for the half cells of which a point lies in one.
#pragma once

#include "cutting/bonds.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/half_cell.h"

namespace tissue_sim {

/// Whether a point within `radius` of `x` may lie in the collider; with a radius of 0, whether x
/// does, up to rounding.
__device__ __forceinline__ bool may_touch(const Collider& c, const float* x, float radius) {
  float p[3];
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) return p[2] < radius;
  if (c.kind == Collider::kCapsule) {
    const float z = p[2] - fminf(fmaxf(p[2], -c.length), -c.radius), reach = c.radius + radius;
    return p[0] * p[0] + p[1] * p[1] + z * z < reach * reach;
  }
  return p[2] < radius && p[2] > -c.length - radius && fabsf(p[1]) < radius + 0.5f * c.thickness &&
         p[0] < radius && p[0] > -c.width - radius;
}

/// A word has room for so many of a bundle's colliders; those with the same remainder share a bit.
inline constexpr int kColliderBits = 15;

/// The colliders `near` in which a point at x lies, as kColliderBits. A blade pushes only points
/// that have lost a bond.
__device__ __forceinline__ std::uint32_t touched_by(const CudaTables& t, const Collider* colliders,
                                                    std::uint32_t near, const float* x, int p) {
  std::uint32_t touched = 0;
  for (std::uint32_t left = near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    if (!may_touch(colliders[c], x, 0)) continue;
    if (colliders[c].kind == Collider::kBlade && t.bonds[p] == kAllBonds) continue;
    touched |= 1u << c % kColliderBits;
  }
  return touched;
}

/// Reference place of the point at sub-position s of cell z of the column [m].
__device__ __forceinline__ void place_in_column(const CudaColumn& c, float cell_size, int z, int s,
                                                float (&place)[3]) {
  place[0] = c.middle[0] + ((s & 1) != 0 ? 0.25f : -0.25f) * cell_size;
  place[1] = c.middle[1] + ((s & 2) != 0 ? 0.25f : -0.25f) * cell_size;
  place[2] = c.middle[2] + cell_size * (z + ((s & 4) != 0 ? 0.25f : -0.25f));
}

/// Velocity [m/s] of the point at sub-position s, from its 27 nodes, of which `first` is the
/// lowest.
__device__ __forceinline__ void point_velocity(const float4* v, int first, int pitch, int plane,
                                               int s, float cell_size, float (&velocity)[3]) {
  velocity[0] = velocity[1] = velocity[2] = 0;
#pragma unroll 1  // the code of all this does not stay in the instruction cache as it is
  for (int z = 0; z < 3; ++z) {
    const float along_z = cell_size * lattice_weight(s >> 2, z);
#pragma unroll
    for (int k = 0; k < 9; ++k) {
      const float4 at = v[first + z * plane + k / 3 * pitch + k % 3];
      const float w = along_z * lattice_weight(s & 1, k % 3) * lattice_weight(s >> 1 & 1, k / 3);
      velocity[0] += w * at.x;
      velocity[1] += w * at.y;
      velocity[2] += w * at.z;
    }
  }
}

/// Lists of cells and of half cells, in the exchange's shared memory: see bytes().
struct PushLists {
  int *cell_count, *half_count;
  std::uint32_t* touched;  ///< [columns][2], bit z: a point of that half of cell z is pushed
  std::uint16_t* cells;    ///< column + (z << 8)
  /// column + (z << 8) + (half << 12) + (bits of its points << 13) + (kColliderBits << 17)
  std::uint32_t* halves;

  __device__ __forceinline__ PushLists(float4* shared, const CudaBundle& w) {
    cell_count = reinterpret_cast<int*>(shared);
    half_count = cell_count + 1;
    touched = reinterpret_cast<std::uint32_t*>(cell_count + 4);
    halves = touched + 2 * w.columns;
    cells = reinterpret_cast<std::uint16_t*>(halves + 2 * w.columns * w.nz);
  }
  /// What they take for so many half cells, at most.
  static std::size_t bytes(int halves) { return 16 + 9 * static_cast<std::size_t>(halves); }
};

/// Lists the half cells near `colliders` of which a point lies in one, and puts the places of such
/// points to `places`, where their pushes will be; the other points of these cells forget where
/// they were held.
__device__ __forceinline__ void list_touched(const CudaTables& t, const CudaBundle& w,
                                             const CudaBlock& block, const CudaBody& body,
                                             const float4* u, const Collider* colliders,
                                             std::uint32_t near, const PushLists& lists,
                                             HalfPush* places) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  for (int i = thread; i < 2 * w.columns; i += threads) lists.touched[i] = 0;
  if (thread == 0) *lists.cell_count = *lists.half_count = 0;
  __syncthreads();
  for (int i = thread; i < 2 * w.columns; i += threads) {
    const CudaColumn c = column_of(t, w, block, body.cell_size, i / 2);
    for (int z = i % 2; z < c.nz; z += 2) {
      // The cell's points lie within two cells of its middle, stretched as they may be.
      const float4 at = u[c.slot + (z + 1) * c.plane + c.pitch + 1];
      const float middle[3] = {c.middle[0] + body.cell_size * at.x,
                               c.middle[1] + body.cell_size * at.y,
                               c.middle[2] + body.cell_size * (z + at.z)};
      bool close = false;
      for (std::uint32_t left = near; left != 0 && !close; left &= left - 1) {
        close = may_touch(colliders[__ffs(static_cast<int>(left)) - 1], middle, 2 * body.cell_size);
      }
      if (!close) continue;
      lists.cells[atomicAdd(lists.cell_count, 1)] = static_cast<std::uint16_t>(i / 2 + (z << 8));
    }
  }
  __syncthreads();
  for (int i = thread; i < 2 * *lists.cell_count; i += threads) {
    const int cell = lists.cells[i / 2], sz = i % 2, z = cell >> 8;
    const CudaColumn c = column_of(t, w, block, body.cell_size, cell & 255);
    HalfPlane h[3];
    int point[4];
    bool holds[4];
#pragma unroll
    for (int q = 0; q < 4; ++q) point[q] = t.point[c.lane + (z * 8 + 4 * sz + q) * c.step];
    read_half(u + c.slot + z * c.plane, c.pitch, c.plane, sz == 0 ? -1.0f : 1.0f, h);
    // After the nodes, which hide the points' way.
#pragma unroll
    for (int q = 0; q < 4; ++q) {
      const std::uint8_t* with = t.with + point[q] * t.held_by;
      holds[q] = point[q] >= 0 && (with[0] | with[t.held_by - 1]) != 0;
    }
    std::uint32_t pushed = 0, by = 0;
#pragma unroll
    for (int q = 0; q < 4; ++q) {
      if (point[q] < 0) continue;
      float x[3];
      place_in_column(c, body.cell_size, z, 4 * sz + q, x);
      const float side_x = (q & 1) != 0 ? 1.0f : -1.0f, side_y = (q & 2) != 0 ? 1.0f : -1.0f;
#pragma unroll
      for (int a = 0; a < 3; ++a) x[a] += body.cell_size * point_value(h[a], side_x, side_y);
      const std::uint32_t touched = touched_by(t, colliders, near, x, point[q]);
      by |= touched;
      if (touched != 0) {
        pushed |= 1u << q;
        HalfPush& place = places[(z * w.columns + (cell & 255)) * 2 + sz];
#pragma unroll
        for (int a = 0; a < 3; ++a) place.of[a][q] = x[a];
      } else if (holds[q]) {
        for (int slot = 0; slot < t.held_by; ++slot) t.with[point[q] * t.held_by + slot] = 0;
      }
    }
    if (pushed == 0) continue;
    lists.halves[atomicAdd(lists.half_count, 1)] = static_cast<std::uint32_t>(cell) |
                                                   static_cast<std::uint32_t>(sz) << 12 |
                                                   pushed << 13 | by << 17;
    atomicOr(lists.touched + 2 * (cell & 255) + sz, 1u << z);
  }
  __syncthreads();
}

}  // namespace tissue_sim
