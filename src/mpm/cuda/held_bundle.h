// Nodes of a bundle of whole tissue that anchors' faces hold, brought to shared memory with all
// others. For .cu files.
#pragma once

#include "mpm/cuda/hold_faces.h"

namespace tissue_sim {

/// What a thread moves in a round: a node of a row, of which four lanes side by side have the four;
/// or a slot's node that no row has. In shared memory, by their number; rows come first.
struct BundleItems {
  SlotCache of;     ///< `node`, never below 0; `shared`, `parts`, `more`
  int* local;       ///< CudaHeldNode::local
  float4* row;      ///< of rows' nodes weight, share, arm and CudaHeldNode::anchor
  int* impulse;     ///< CudaHeldNode::impulse
  int* free_count;  ///< items that are of no row

  static constexpr std::size_t kBytes = 28, kRowBytes = 20;  ///< of each, without `more`
};

/// Bit of SlotCache::shared for an item on which no force acts.
inline constexpr std::uint32_t kForceless = 1u << 30;

/// All threads; `marks` is room for a number of each slot. They must meet before they use it.
__device__ __forceinline__ void fill_items(const CudaTables& t, const CudaHeldFaces& h,
                                           const HeldOfBundle& of, const CudaBundle& bundle,
                                           float4* marks, const BundleItems& items) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  for (int i = thread; i < bundle.slots; i += threads) marks[i].x = 0;
  if (thread == 0) *items.free_count = 0;
  __syncthreads();
  for (int i = thread; i < of.count; i += threads) {
    const CudaHeldNode n = h.held[of.first + i];
    const bool forceless = n.node < 0 || n.shared == kNoSlot;
    items.of.node[i] = max(n.node, 0);
    items.of.shared[i] = forceless ? kForceless : n.shared;
    items.of.parts[i] = forceless ? uint4{0, 0, 0, 0} : n.parts;
    if (items.of.more != nullptr) items.of.more[i] = forceless ? uint4{0, 0, 0, 0} : n.more;
    items.local[i] = n.local;
    items.row[i] = {n.node < 0 ? 0 : n.weight, n.share, n.arm, __int_as_float(n.anchor)};
    items.impulse[i] = n.impulse;
    if (n.local >= 0) marks[n.local & (kOwnedHere - 1)].x = 1;
  }
  __syncthreads();
  for (int i = thread; i - thread % 32 < bundle.slots; i += threads) {
    const bool is_free = i < bundle.slots && marks[min(i, bundle.slots - 1)].x == 0;
    const unsigned others = __ballot_sync(0xffffffffu, is_free);
    int first = 0;
    if (thread % 32 == 0) first = atomicAdd(items.free_count, __popc(others));
    first = __shfl_sync(0xffffffffu, first, 0);
    if (!is_free) continue;
    const int at = of.count + first + __popc(others & ((1u << thread % 32) - 1));
    const int slot = bundle.first_slot + i;
    const std::int32_t entry = t.slot_node[slot];
    const std::uint32_t shared = t.slot_parts[slot];
    items.of.node[at] = entry < 0 ? ~entry : entry;
    items.of.shared[at] = shared;
    items.of.parts[at] = t.first_parts[slot];
    if (items.of.more != nullptr) items.of.more[at] = more_parts(t, shared);
    items.local[at] = entry < 0 ? i : i | kOwnedHere;
  }
}

/// Before the first substep nothing moves.
__device__ __forceinline__ void place_items(const BundleItems& items, int count,
                                            const CudaNodes& from, float scale, float4* u_out,
                                            float4* v_out) {
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    const int local = items.local[i] & (kOwnedHere - 1);
    if (items.local[i] < 0) continue;
    const float4 u = __ldcg(from.u + items.of.node[i]);
    u_out[local] = {scale * u.x, scale * u.y, scale * u.z, 0};
    if (v_out == nullptr) continue;
    const float4 v = __ldcg(from.v + items.of.node[i]);
    v_out[local] = {scale * v.x, scale * v.y, scale * v.z, 0};
  }
}

/// As bring_nodes(), and holds the rows: four lanes move a row's nodes as if they were free, add up
/// what the face lacks and put them where the row's impulse leaves them. All bundles that have
/// nodes of a row work it out alike.
template <int kHand>
__device__ __forceinline__ void bring_items(const CudaTables& t, const CudaFrame& f,
                                            const BundleItems& items, int held, int count,
                                            int round, const CudaNodes& from, const CudaNodes& to,
                                            const float4* force, float scale, float4* u_out,
                                            float4* v_out) {
  const CudaHeldFaces& h = f.held_faces;
  const NodeStep& step = f.step;
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const float inv_dt = 1 / step.dt;
  const float4* const pull =
      h.pull == nullptr ? nullptr : h.pull + 4 * static_cast<std::size_t>(round - 1) * h.anchors;
  // What the next substep reads for the first time comes from afar.
  if (pull != nullptr && round < f.substeps && thread < h.anchors) {
    asm volatile("prefetch.global.L2 [%0];" ::"l"(pull + 4 * (h.anchors + thread)));
  }
  for (int i = thread; i - thread % 32 < count; i += kHand * threads) {
    float4 u[kHand], v[kHand], p[kHand], more[kHand][7] = {}, row[kHand] = {}, m[kHand] = {};
    std::uint32_t shared[kHand];
    uint4 next_parts[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int at = min(i + k * threads, count - 1);
      const std::int32_t node = items.of.node[at];
      u[k] = __ldcg(from.u + node);
      v[k] = __ldcg(from.v + node);
      shared[k] = items.of.shared[at];
      const uint4 parts = items.of.parts[at];
      p[k] = {0, 0, 0, 0};
      if ((shared[k] & kForceless) == 0) p[k] = __ldcg(force + parts.x);
      const std::uint32_t part_count = shared[k] & 63u;
      if (part_count > 1) more[k][0] = __ldcg(force + parts.y);
      if (part_count > 2) more[k][1] = __ldcg(force + parts.z);
      if (part_count > 3) more[k][2] = __ldcg(force + parts.w);
      next_parts[k] = items.of.more != nullptr ? items.of.more[at] : more_parts(t, shared[k]);
      if (at < held) {
        row[k] = items.row[at];
        const int anchor = __float_as_int(row[k].w) & ~kSwings;
        if (pull != nullptr) m[k] = __ldg(pull + 4 * anchor + thread % 4);
      }
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const std::uint32_t part_count = shared[k] & 63u;
      if (part_count > 4) more[k][3] = __ldcg(force + next_parts[k].x);
      if (part_count > 5) more[k][4] = __ldcg(force + next_parts[k].y);
      if (part_count > 6) more[k][5] = __ldcg(force + next_parts[k].z);
      if (part_count > 7) more[k][6] = __ldcg(force + next_parts[k].w);
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int at = i + k * threads;
      if (at - thread % 32 >= count) break;
      for (const float4& q : more[k]) add(q, p[k]);
      const int part_count = static_cast<int>(shared[k] & 63u);
#pragma unroll 1
      for (int q = 8; q < part_count; ++q) {
        add(__ldcg(force + __ldg(t.parts + ((shared[k] & ~kForceless) >> 6) + q)), p[k]);
      }
      step.move(0, p[k].x, u[k].w, v[k].w, u[k].x, v[k].x);
      step.move(1, p[k].y, u[k].w, v[k].w, u[k].y, v[k].y);
      step.move(2, p[k].z, u[k].w, v[k].w, u[k].z, v[k].z);
      if (at - thread % 32 < held) {
        if ((__float_as_int(row[k].w) & kSwings) != 0) {
          calm_swing(h.swing_loss, step.dt, u[k], v[k]);
        }
        // As in hold_group(): what the velocity at the face lacks.
        const float of_u = h.drift * inv_dt, of_v = 1 - h.drift;
        const float weight = row[k].x, share = row[k].y, arm = inv_dt * row[k].z;
        const float x = sum_of_four(arm * m[k].x - weight * (of_v * v[k].x + of_u * u[k].x)),
                    y = sum_of_four(arm * m[k].y - weight * (of_v * v[k].y + of_u * u[k].y)),
                    z = sum_of_four(arm * m[k].z - weight * (of_v * v[k].z + of_u * u[k].z));
        if (at < held && h.impulse != nullptr && items.impulse[at] >= 0) {
          const int c = thread % 4;
          atomicAdd(h.impulse + items.impulse[at], static_cast<double>(c == 0   ? x
                                                                       : c == 1 ? y
                                                                                : z));
        }
        const float dx = share * x, dy = share * y, dz = share * z;
        v[k].x += dx, v[k].y += dy, v[k].z += dz;
        u[k].x += step.dt * dx, u[k].y += step.dt * dy, u[k].z += step.dt * dz;
      }
      if (at >= count) continue;
      const int local = items.local[at];
      if (local < 0) continue;
      const int slot = local & (kOwnedHere - 1);
      u_out[slot] = {scale * u[k].x, scale * u[k].y, scale * u[k].z, 0};
      if (v_out != nullptr) v_out[slot] = {scale * v[k].x, scale * v[k].y, scale * v[k].z, 0};
      if ((local & kOwnedHere) == 0) continue;
      const std::int32_t node = items.of.node[at];
      __stcg(to.u + node, u[k]);
      __stcg(to.v + node, v[k]);
    }
  }
}

/// Puts what anchors carry where they are in the last substep of a launch. All threads, after they
/// met.
__device__ __forceinline__ void carry_nodes(const CudaTables& t, const CudaFrame& f, int bundle,
                                            int round, const CudaNodes& from, const CudaNodes& to) {
  const CudaHeldFaces& h = f.held_faces;
  const CudaAnchorPlace* const before = h.places + (round - 1) * h.anchors;
  const int end = __ldg(h.first_carried + bundle + 1);
  for (int i = __ldg(h.first_carried + bundle) + static_cast<int>(threadIdx.x); i < end;
       i += static_cast<int>(blockDim.x)) {
    const CudaCarriedNode n = h.carried[i];
    if (__ldg(t.slot_node + n.slot) < 0) continue;
    float is[3], rate[3];
    for (int c = 0; c < 3; ++c) {
      const double was = moved(before[n.anchor], n.place, c);
      const double now = moved(before[h.anchors + n.anchor], n.place, c);
      is[c] = static_cast<float>(now);
      rate[c] = static_cast<float>((now - was) / f.step.dt);
    }
    __stcg(to.u + n.node, float4{is[0], is[1], is[2], __ldcg(&from.u[n.node].w)});
    __stcg(to.v + n.node, float4{rate[0], rate[1], rate[2], __ldcg(&from.v[n.node].w)});
  }
}

}  // namespace tissue_sim
