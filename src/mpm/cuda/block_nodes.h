// A block's nodes in shared memory. For .cu files.
#pragma once

#include "mpm/cuda/added_mass.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// What a slot's node and the first parts of its force are, for a block that stays where it is from
/// substep to substep to keep in shared memory.
struct SlotCache {
  std::int32_t* node;     ///< CudaTables::slot_node
  std::uint32_t* shared;  ///< CudaTables::slot_parts
  uint4* parts;           ///< the first four slots that share the node
  uint4* more;            ///< the next four; null where there is no room
};

/// Marks a slot whose node contact may push.
__device__ __forceinline__ void mark_slot(const std::int32_t* slot_node,
                                          const std::uint32_t* slot_parts,
                                          const std::uint8_t* marks, std::size_t slot,
                                          std::uint32_t* pushed_parts) {
  const std::int32_t entry = slot_node[slot];
  const bool pushed = marks[entry < 0 ? ~entry : entry] != 0;
  pushed_parts[slot] = slot_parts[slot] | (pushed ? kPushed : 0);
}

/// Slots 4 to 7 that share a node.
__device__ __forceinline__ uint4 more_parts(const CudaTables& t, std::uint32_t shared) {
  const std::uint32_t *part = t.parts + (shared >> 6) + 4, count = shared & 63u;
  return {count > 4 ? __ldg(part) : 0, count > 5 ? __ldg(part + 1) : 0,
          count > 6 ? __ldg(part + 2) : 0, count > 7 ? __ldg(part + 3) : 0};
}

__device__ __forceinline__ void fill_cache(const CudaTables& t, int first_slot, int slots,
                                           const SlotCache& cache) {
  for (int i = static_cast<int>(threadIdx.x); i < slots; i += static_cast<int>(blockDim.x)) {
    const int slot = first_slot + i;
    const std::uint32_t shared = t.slot_parts[slot] & ~kPushed;
    cache.node[i] = t.slot_node[slot];
    cache.shared[i] = t.slot_parts[slot];
    cache.parts[i] = t.first_parts[slot];
    if (cache.more != nullptr) cache.more[i] = more_parts(t, shared);
  }
}

/// Sums of pushes on the nodes: that of the substep before and the one to clear.
struct PushedNodes {
  const long long* force;
  long long* clear;
  const long long* inertia = nullptr;  ///< NodePushes::inertia, the same two
  long long* clear_inertia = nullptr;
};

/// The sums of pushes that a round reads and clears.
__device__ __forceinline__ PushedNodes pushed_nodes(const NodePushes& p, int round) {
  const int read = (round + 2) % 3, clear = (round + 1) % 3;
  PushedNodes of{p.force + p.stride * read, p.force + p.stride * clear};
  if (p.inertia != nullptr) {
    of.inertia = p.inertia + p.inertia_stride * read;
    of.clear_inertia = p.inertia + p.inertia_stride * clear;
  }
  return of;
}

/// What contact pushes a node with.
struct Pushed {
  long long force[3];
  int inert;  ///< 1 + a collider that has added masses at it; 0: none has

  __device__ __forceinline__ Pushed(const PushedNodes& pushed, bool marked, bool clear, int node) {
    force[0] = force[1] = force[2] = 0;
    inert = 0;
    if (!marked) return;
    const std::size_t first = kPushStride * static_cast<std::size_t>(node);
    const longlong2 xy = __ldcg(reinterpret_cast<const longlong2*>(pushed.force + first));
    force[0] = xy.x;
    force[1] = xy.y;
    const longlong2 z = __ldcg(reinterpret_cast<const longlong2*>(pushed.force + first + 2));
    force[2] = z.x;
    inert = static_cast<int>(z.y);
    if (!clear) return;
    __stcg(reinterpret_cast<longlong2*>(pushed.clear + first), longlong2{0, 0});
    __stcg(reinterpret_cast<longlong2*>(pushed.clear + first + 2), longlong2{0, 0});
    if (pushed.clear_inertia == nullptr) return;
    auto* tensor = reinterpret_cast<longlong2*>(pushed.clear_inertia +
                                                kInertiaStride * static_cast<std::size_t>(node));
#pragma unroll
    for (int i = 0; i < kInertiaStride / 2; ++i) __stcg(tensor + i, longlong2{0, 0});
  }
  Pushed() = default;
  __device__ __forceinline__ float of(int c) const {
    return __ll2float_rn(force[c]) * static_cast<float>(kLoadUnit);
  }
};

/// Takes back what a node's added masses resist of the step that brought it to u and v. Returns how
/// much of v that is [m/s].
__device__ __forceinline__ float3 resist(const PushedNodes& pushed, int node, const NodeStep& step,
                                         const CudaNodes& from, float4& u, float4& v) {
  const float4 was = __ldcg(from.v + node);
  const float3 r = resisted(pushed.inertia + kInertiaStride * static_cast<std::size_t>(node), v.w,
                            step.keep, {was.x, was.y, was.z}, {v.x, v.y, v.z});
  v.x -= r.x, v.y -= r.y, v.z -= r.z;
  u.x = __fmaf_rn(-step.dt, r.x, u.x);
  u.y = __fmaf_rn(-step.dt, r.y, u.y);
  u.z = __fmaf_rn(-step.dt, r.z, u.z);
  return r;
}

__device__ __forceinline__ void add(const float4& p, float4& f) {
  f.x += p.x;
  f.y += p.y;
  f.z += p.z;
}

/// What the tables say of a slot. Without kMove only its node is needed.
template <bool kMove>
struct SlotEntry {
  std::int32_t node;
  std::uint32_t shared;
  uint4 parts;

  __device__ __forceinline__ void load(const CudaTables& t, int slot) {
    node = __ldg(t.slot_node + slot);
    shared = kMove ? __ldg(t.slot_parts + slot) : 0;
    if (kMove) parts = __ldg(t.first_parts + slot);
  }
  __device__ __forceinline__ void load(const SlotCache& cache, int local) {
    node = cache.node[local];
    shared = kMove ? cache.shared[local] : 0;
    if (kMove) parts = cache.parts[local];
  }
};

/// Brings the nodes of `count` slots into `u_out` and `v_out`, where they are not null (divided by
/// the cell size, so that stencils give gradients). With `kMove` it first moves them on by the
/// forces of the last substep, summed in the order of the slots; every block that has a node
/// computes the same, and the one that owns it writes it down, and what its added masses bore to
/// `loads`. Each thread has kHand nodes in hand, for all their loads to be under way at once; what
/// the tables say of the next ones comes meanwhile. `pushes` is read with kPushes alone.
template <bool kMove, bool kCached, int kHand, bool kPushes = false>
__device__ __forceinline__ void bring_nodes(const CudaTables& t, int first_slot, int count,
                                            const SlotCache& cache, const CudaNodes& from,
                                            const CudaNodes& to, const float4* force,
                                            const NodeStep& step, float scale, float4* u_out,
                                            float4* v_out, const PushedNodes& pushes = {},
                                            const InertialLoads& loads = {}) {
  const int threads = static_cast<int>(blockDim.x);
  SlotEntry<kMove> coming[kHand];
  const auto load_entries = [&](int i) {
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int local = min(i + k * threads, count - 1);
      if (kCached) {
        coming[k].load(cache, local);
      } else {
        coming[k].load(t, first_slot + local);
      }
    }
  };
  if (!kCached) load_entries(static_cast<int>(threadIdx.x));
  for (int i = static_cast<int>(threadIdx.x); i < count; i += kHand * threads) {
    if (kCached) load_entries(i);
    std::int32_t node[kHand];
    std::uint32_t shared[kHand];
    bool owned[kHand];
    float4 u[kHand], v[kHand], f[kHand], more[kHand][7] = {};
    uint4 next_parts[kHand];
    Pushed push[kHand];
    bool pushed[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      owned[k] = coming[k].node >= 0;
      node[k] = owned[k] ? coming[k].node : ~coming[k].node;
      shared[k] = coming[k].shared;
      u[k] = __ldcg(from.u + node[k]);
      if (kMove || v_out != nullptr) v[k] = __ldcg(from.v + node[k]);
      if (!kMove) continue;
      if (kPushes) {
        pushed[k] = (shared[k] & kPushed) != 0;
        push[k] = Pushed(pushes, pushed[k], owned[k], node[k]);
        shared[k] &= ~kPushed;
      }
      f[k] = __ldcg(force + coming[k].parts.x);
      const std::uint32_t part_count = shared[k] & 63u;
      if (part_count > 1) more[k][0] = __ldcg(force + coming[k].parts.y);
      if (part_count > 2) more[k][1] = __ldcg(force + coming[k].parts.z);
      if (part_count > 3) more[k][2] = __ldcg(force + coming[k].parts.w);
      next_parts[k] = kCached && cache.more != nullptr ? cache.more[min(i + k * threads, count - 1)]
                                                       : more_parts(t, shared[k]);
    }
    if (!kCached) load_entries(i + kHand * threads);
#pragma unroll
    for (int k = 0; kMove && k < kHand; ++k) {
      const std::uint32_t part_count = shared[k] & 63u;
      if (part_count > 4) more[k][3] = __ldcg(force + next_parts[k].x);
      if (part_count > 5) more[k][4] = __ldcg(force + next_parts[k].y);
      if (part_count > 6) more[k][5] = __ldcg(force + next_parts[k].z);
      if (part_count > 7) more[k][6] = __ldcg(force + next_parts[k].w);
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int at = i + k * threads;
      if (at >= count) break;
      if (kMove) {
        for (const float4& p : more[k]) add(p, f[k]);
        const int part_count = static_cast<int>(shared[k] & 63u);
#pragma unroll 4
        for (int p = 8; p < part_count; ++p) {
          add(__ldcg(force + __ldg(t.parts + (shared[k] >> 6) + p)), f[k]);
        }
        if (kPushes && pushed[k]) add({push[k].of(0), push[k].of(1), push[k].of(2), 0}, f[k]);
        step.move(0, f[k].x, u[k].w, v[k].w, u[k].x, v[k].x);
        step.move(1, f[k].y, u[k].w, v[k].w, u[k].y, v[k].y);
        step.move(2, f[k].z, u[k].w, v[k].w, u[k].z, v[k].z);
        if (kPushes && push[k].inert != 0) {
          const float3 r = resist(pushes, node[k], step, from, u[k], v[k]);
          if (owned[k]) {
            const float by = u[k].w / step.kick;
            add_resisted(
                loads, push[k].inert - 1, first_slot + at,
                {u[k].x - step.dt * v[k].x, u[k].y - step.dt * v[k].y, u[k].z - step.dt * v[k].z},
                {by * r.x, by * r.y, by * r.z});
          }
        }
        if (owned[k]) {
          __stcg(to.u + node[k], u[k]);
          __stcg(to.v + node[k], v[k]);
        }
      }
      if (u_out != nullptr) u_out[at] = {scale * u[k].x, scale * u[k].y, scale * u[k].z, 0};
      if (v_out != nullptr) v_out[at] = {scale * v[k].x, scale * v[k].y, scale * v[k].z, 0};
    }
  }
}

/// Column `index` of a bundle, `block` its first: from memory only where it must be. Where anchors
/// hold all of it, it has no columns, and this is one of the block's that nobody works on.
__device__ __forceinline__ CudaColumn column_of(const CudaTables& t, const CudaBundle& w,
                                                const CudaBlock& block, int index) {
  if (w.columns == 0 || (w.blocks == 1 && w.columns == block.nx * block.ny)) {
    return column_of(block, index);
  }
  return t.columns[w.first_column + index];
}

/// Lane of the point at sub-position s of cell (x, y, z).
__device__ __forceinline__ int lane_of(const CudaBlock& b, int x, int y, int z, int s) {
  return b.first_lane + ((z * 8 + s) * b.ny + y) * b.nx + x;
}

/// Reference place of that point [m].
__device__ __forceinline__ void reference_place(const CudaBlock& b, float cell_size, int x, int y,
                                                int z, int s, float (&place)[3]) {
  place[0] = b.origin[0] + cell_size * (x + ((s & 1) != 0 ? 1.25f : 0.75f));
  place[1] = b.origin[1] + cell_size * (y + ((s & 2) != 0 ? 1.25f : 0.75f));
  place[2] = b.origin[2] + cell_size * (z + ((s & 4) != 0 ? 1.25f : 0.75f));
}

}  // namespace tissue_sim
