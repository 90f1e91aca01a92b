// What colliders push the points of a bundle with, before its forces. For .cu files.
//
// Few points are near a tool, but all of a tool's lie in few blocks, and the slowest block decides
// how long a substep takes. So all threads look for them together: first for the cells near a
// collider, then for the half cells of which a point lies in one; only these are worked out.
#pragma once

#include "cutting/bonds.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/half_cell.h"

namespace tissue_sim {

/// Adds forces and moments of all lanes of a warp to a load in shared memory, as integers, whose
/// sum does not depend on the order.
__device__ __forceinline__ void add_load(unsigned long long* load, const double (&value)[6]) {
  long long sum[6];
#pragma unroll
  for (int i = 0; i < 6; ++i) sum[i] = __double2ll_rn(value[i] * (1 / kLoadUnit));
#pragma unroll
  for (int step = 16; step > 0; step /= 2) {
#pragma unroll
    for (int i = 0; i < 6; ++i) sum[i] += __shfl_xor_sync(0xffffffffu, sum[i], step);
  }
  const int lane = static_cast<int>(threadIdx.x) % 32;
  long long mine = sum[0];
#pragma unroll
  for (int i = 1; i < 6; ++i) mine = lane == i ? sum[i] : mine;
  if (lane < 6) atomicAdd(load + lane, static_cast<unsigned long long>(mine));
}

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

/// Lists of cells and of half cells, in the exchange's shared memory: room for kMaxLayers.
struct PushLists {
  int *cell_count, *half_count;
  std::uint32_t* touched;  ///< [threads], bit z: a point of the thread's half cell z is pushed
  std::uint16_t* cells;    ///< column + (z << 8)
  /// column + (z << 8) + (half << 12) + (bits of its points << 13) + (kColliderBits << 17)
  std::uint32_t* halves;

  __device__ __forceinline__ PushLists(float4* shared, const CudaBundle& w) {
    cell_count = reinterpret_cast<int*>(shared);
    half_count = cell_count + 1;
    touched = reinterpret_cast<std::uint32_t*>(cell_count + 4);
    halves = touched + blockDim.x;
    cells = reinterpret_cast<std::uint16_t*>(halves + 2 * w.columns * w.nz);
  }
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
  lists.touched[thread] = 0;
  if (thread == 0) *lists.cell_count = *lists.half_count = 0;
  __syncthreads();
  if (thread / 2 < w.columns) {
    const CudaColumn c = column_of(t, w, block, body.cell_size, thread / 2);
    for (int z = thread % 2; z < c.nz; z += 2) {
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
      lists.cells[atomicAdd(lists.cell_count, 1)] =
          static_cast<std::uint16_t>(thread / 2 + (z << 8));
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
#pragma unroll
    for (int q = 0; q < 4; ++q) {
      const std::uint8_t* with = t.with + point[q] * t.held_by;
      holds[q] = point[q] >= 0 && (with[0] | with[t.held_by - 1]) != 0;
    }
    read_half(u + c.slot + z * c.plane, c.pitch, c.plane, HalfWeights(sz == 0 ? -1.0f : 1.0f), h);
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

/// What a point remembers of its contacts: CudaTables::with and hold.
struct Held {
  int with[2] = {0, 0};
  float place[2][3] = {};

  __device__ __forceinline__ void load(const CudaTables& t, int p) {
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      with[slot] = t.with[p * t.held_by + slot];
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        place[slot][a] = t.hold[3 * (static_cast<std::size_t>(p) * t.held_by + slot) + a];
      }
    }
  }
  __device__ __forceinline__ void store(const CudaTables& t, int p) const {
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      t.with[p * t.held_by + slot] = static_cast<std::uint8_t>(with[slot]);
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        t.hold[3 * (static_cast<std::size_t>(p) * t.held_by + slot) + a] = place[slot][a];
      }
    }
  }
};

/// Force of the colliders on the point `p` [N], whose load goes to `loads`. All lanes of a warp
/// take part; `by` are the colliders it may lie in, as kColliderBits, 0 where there is no point.
__device__ __forceinline__ void push_point(const CudaTables& t, const Collider* colliders,
                                           std::uint32_t near, std::uint32_t by, int p, Held& held,
                                           const ContactSpring& spring, const float (&x)[3],
                                           const float (&v)[3], unsigned long long* loads,
                                           float (&sum)[3]) {
  bool holds[2] = {false, false};
  for (std::uint32_t left = near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    const bool maybe = (by >> c % kColliderBits & 1u) != 0;
    if (__ballot_sync(0xffffffffu, maybe) == 0) continue;
    const Collider& collider = colliders[c];
    const Gap g = gap(collider, x);
    float push[3] = {0, 0, 0};
    if (maybe && g.distance < 0 &&
        !(collider.kind == Collider::kBlade && t.bonds[p] == kAllBonds)) {
      const bool second =
          t.held_by == 2 && (held.with[1] == c + 1 || (held.with[0] != 0 && held.with[0] != c + 1));
      float place[3];
#pragma unroll
      for (int a = 0; a < 3; ++a) place[a] = second ? held.place[1][a] : held.place[0][a];
      if ((second ? held.with[1] : held.with[0]) != c + 1) to_local(collider, x, place);
      contact_force(collider, g, spring, x, v, place, push);
      (second ? held.with[1] : held.with[0]) = c + 1;
      (second ? holds[1] : holds[0]) = true;
#pragma unroll
      for (int a = 0; a < 3; ++a) (second ? held.place[1][a] : held.place[0][a]) = place[a];
#pragma unroll
      for (int a = 0; a < 3; ++a) sum[a] += push[a];
    }
    if (collider.tool < 0) continue;  // nobody asks what the ground carries
    double arm[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) arm[a] = static_cast<double>(x[a]) - collider.position[a];
    double load[6];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      load[a] = -push[a];
      load[3 + a] = -(arm[b] * push[d] - arm[d] * push[b]);
    }
    add_load(loads + 6 * c, load);
  }
#pragma unroll
  for (int slot = 0; slot < 2; ++slot) {
    if (!holds[slot]) held.with[slot] = 0;
  }
}

/// Half cells of the thread, as bits, and whether any of the bundle's, that colliders push.
struct Touched {
  std::uint32_t halves;
  bool any;
};

/// Works out what the colliders push the points of a bundle with, into `pushes`. The nodes are in
/// `u` and `v`, divided by the cell size; `shared` is room for the lists, `block` the bundle's
/// first. Out of line, for the forces to keep their registers.
inline __device__ __noinline__ Touched find_pushes(const CudaTables t, const CudaBundle w,
                                                   const CudaBlock block, const CudaBody body,
                                                   const float4* u, const float4* v, float4* shared,
                                                   const Collider* colliders, std::uint32_t near,
                                                   unsigned long long* loads, HalfPush* pushes) {
  const PushLists lists(shared, w);
  list_touched(t, w, block, body, u, colliders, near, lists, pushes);
  const int thread = static_cast<int>(threadIdx.x), points = 4 * *lists.half_count;
  for (int i = thread; i / 32 * 32 < points; i += static_cast<int>(blockDim.x)) {
    const std::uint32_t half = i < points ? lists.halves[i / 4] : 0;
    const int z = static_cast<int>(half >> 8 & 15u), sz = static_cast<int>(half >> 12 & 1u);
    const bool touches = (half >> (13 + i % 4) & 1u) != 0;
    HalfPush& of_half = pushes[(z * w.columns + static_cast<int>(half & 255u)) * 2 + sz];
    float push[3] = {0, 0, 0}, x[3] = {0, 0, 0}, velocity[3] = {0, 0, 0}, volume = 0;
    int p = 0;
    Held held;
    if (touches) {
      const int index = static_cast<int>(half & 255u), s = 4 * sz + i % 4;
      const CudaColumn c = column_of(t, w, block, body.cell_size, index);
      const int lane = c.lane + (z * 8 + s) * c.step;
#pragma unroll
      for (int a = 0; a < 3; ++a) x[a] = of_half.of[a][i % 4];
      p = t.point[lane];
      volume = c.whole != 0 ? body.point_volume : t.volume[lane];
      held.load(t, p);
      point_velocity(v, c.slot + z * c.plane, c.pitch, c.plane, s, body.cell_size, velocity);
    }
    push_point(t, colliders, near, touches ? half >> 17 : 0, p, held,
               {body.spring.stiffness * volume, body.spring.damping * volume}, x, velocity, loads,
               push);
    if (i >= points) continue;
    if (touches) held.store(t, p);
#pragma unroll
    for (int a = 0; a < 3; ++a) of_half.of[a][i % 4] = push[a];
  }
  __syncthreads();
  const Touched touched{lists.touched[thread], points > 0};
  __syncthreads();
  return touched;
}

}  // namespace tissue_sim
