// What colliders push the points of a bundle with, before its forces: the half cells that they
// touch alone are worked out. For .cu files.
#pragma once

#include "mpm/cuda/tool_touches.h"

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

/// Which cells of a thread's column have a lower and an upper half that colliders push, as bits,
/// and whether any of the bundle's has.
struct Touched {
  std::uint32_t cells[2];
  bool any;
};

/// Works out what the colliders push the points of a bundle with, into `pushes`. The nodes are in
/// `u` and `v`, divided by the cell size; `shared` is room for the lists, `block` the bundle's
/// first, `column` the thread's. Out of line, for the forces to keep their registers.
inline __device__ __noinline__ Touched find_pushes(const CudaTables t, const CudaBundle w,
                                                   const CudaBlock block, const CudaBody body,
                                                   const float4* u, const float4* v, float4* shared,
                                                   const Collider* colliders, std::uint32_t near,
                                                   unsigned long long* loads, HalfPush* pushes,
                                                   int column) {
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
      point_velocity(v, c.slot + z * c.plane, c.pitch, c.plane, s, body.cell_size, velocity);
      held.load(t, p);
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
  Touched touched = {{0, 0}, points > 0};
  if (column < w.columns) {
    touched.cells[0] = lists.touched[2 * column];
    touched.cells[1] = lists.touched[2 * column + 1];
  }
  __syncthreads();
  return touched;
}

}  // namespace tissue_sim
