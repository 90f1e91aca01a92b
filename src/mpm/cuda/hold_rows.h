// Holds rows of anchors' faces that have no nodes in common with others. For .cu files.
#pragma once

#include "mpm/cuda/block_nodes.h"

namespace tissue_sim {

/// What holding a bundle's faces needs beside CudaHeldFaces.
struct FacesAtWork {
  const std::int32_t* slot_node;
  const std::uint32_t* slot_parts;
  const std::uint32_t* parts;
  CudaNodes from, to;
  const float4* force;
  NodeStep step;
  float scale;
  float4 *u, *v;  ///< the bundle's nodes; `v` may be null
  PushedNodes pushed;
  int bundle, substep;
  bool last;         ///< substep of the launch
  float4* exchange;  ///< clear, and left so
};

/// CudaHeldFaces::held of a bundle in shared memory: by its four words, then by node.
struct HeldCache {
  uint4* word = nullptr;  ///< null where there is none
  int room = 0;           ///< nodes
};

/// Puts a slot's node where it is, in the bundle and, where it is the bundle's to write, in memory.
__device__ __forceinline__ void put_node(const FacesAtWork& w, std::int32_t node, int local,
                                         bool owned, const float4& u, const float4& v) {
  if (w.u != nullptr) w.u[local] = {w.scale * u.x, w.scale * u.y, w.scale * u.z, 0};
  if (w.v != nullptr) w.v[local] = {w.scale * v.x, w.scale * v.y, w.scale * v.z, 0};
  if (!owned) return;
  __stcg(w.to.u + node, u);
  __stcg(w.to.v + node, v);
}

/// What faces hold of a bundle.
struct HeldOfBundle {
  int first = 0, count = 0;  ///< nodes of rows, in CudaHeldFaces::held
  bool grouped = false;      ///< there are rows with nodes in common
  bool carries = false;      ///< there are nodes that anchors carry

  HeldOfBundle() = default;
  __device__ __forceinline__ HeldOfBundle(const CudaHeldFaces& h, int bundle) {
    if (h.chunks == nullptr) return;
    first = __ldg(h.first_held + bundle);
    count = __ldg(h.first_held + bundle + 1) - first;
    grouped = __ldg(&h.chunks[bundle].rows) > 0;
    carries = h.places != nullptr &&
              __ldg(h.first_carried + bundle) < __ldg(h.first_carried + bundle + 1);
  }
};

/// All threads; they must meet before they use it.
__device__ __forceinline__ void fill_held(const CudaHeldFaces& h, const HeldOfBundle& of,
                                          const HeldCache& cache) {
  if (of.count > cache.room) return;
  const uint4* const from = reinterpret_cast<const uint4*>(h.held + of.first);
  for (int i = static_cast<int>(threadIdx.x); i < 4 * of.count; i += static_cast<int>(blockDim.x)) {
    cache.word[i % 4 * cache.room + i / 4] = from[i];
  }
}
/// Marks their slots in the bundle's cache of slots, which is filled.
__device__ __forceinline__ void mark_held(const CudaHeldFaces& h, const HeldOfBundle& of,
                                          const SlotCache& cache) {
  for (int i = static_cast<int>(threadIdx.x); i < of.count; i += static_cast<int>(blockDim.x)) {
    const int local = h.held[of.first + i].local;
    if (local >= 0) cache.shared[local & (kOwnedHere - 1)] |= kHeldSlot;
  }
}

__device__ __forceinline__ CudaHeldNode load_held(const CudaHeldNode* from, const HeldCache& cache,
                                                  bool cached, int i) {
  CudaHeldNode n;
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    reinterpret_cast<uint4*>(&n)[k] = cached ? cache.word[k * cache.room + i]
                                             : __ldg(reinterpret_cast<const uint4*>(from + i) + k);
  }
  return n;
}

/// The sum over four lanes side by side, for all of them.
__device__ __forceinline__ float sum_of_four(float x) {
  x += __shfl_xor_sync(0xffffffffu, x, 1);
  return x + __shfl_xor_sync(0xffffffffu, x, 2);
}

/// Moves the nodes of the bundle's rows on as bring_nodes() would, and holds the rows: each by four
/// lanes, who share nothing with others, so nobody waits. All bundles that have nodes of a row work
/// it out alike. Out of line, for scenes without anchors to keep their registers.
template <bool kPushes>
__device__ __noinline__ void hold_rows(const CudaHeldFaces h, const FacesAtWork w, int first,
                                       int count, const HeldCache cache) {
  constexpr int kHand = 2;
  const bool cached = count <= cache.room;
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const float inv_dt = 1 / w.step.dt;
  const float4* const pull =
      h.pull == nullptr ? nullptr : h.pull + 4 * static_cast<std::size_t>(w.substep) * h.anchors;
  for (int i = thread; i - thread % 32 < count; i += kHand * threads) {
    CudaHeldNode n[kHand];
    float4 u[kHand] = {}, v[kHand] = {}, f[kHand] = {}, more[kHand][7] = {}, m[kHand] = {};
    Pushed push[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int at = i + k * threads;
      n[k] = load_held(h.held + first, cache, cached, min(at, count - 1));
      if (pull != nullptr) m[k] = __ldg(pull + 4 * n[k].anchor + thread % 4);
      if (at < count) continue;
      n[k].node = n[k].local = n[k].impulse = -1;
      n[k].arm = 0;
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      if (n[k].node < 0) continue;
      u[k] = __ldcg(w.from.u + n[k].node);
      v[k] = __ldcg(w.from.v + n[k].node);
      if (n[k].shared == kNoSlot) continue;
      const std::uint32_t parts = n[k].shared & 63u;
      f[k] = __ldcg(w.force + n[k].parts.x);
      if (parts > 1) more[k][0] = __ldcg(w.force + n[k].parts.y);
      if (parts > 2) more[k][1] = __ldcg(w.force + n[k].parts.z);
      if (parts > 3) more[k][2] = __ldcg(w.force + n[k].parts.w);
      if (parts > 4) more[k][3] = __ldcg(w.force + n[k].more.x);
      if (parts > 5) more[k][4] = __ldcg(w.force + n[k].more.y);
      if (parts > 6) more[k][5] = __ldcg(w.force + n[k].more.z);
      if (parts > 7) more[k][6] = __ldcg(w.force + n[k].more.w);
      if (kPushes) push[k] = Pushed(w.pushed, true, false, n[k].node);
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      if (n[k].node >= 0) {
        for (const float4& p : more[k]) add(p, f[k]);
        if (n[k].shared != kNoSlot) {
          for (std::uint32_t p = 8; p < (n[k].shared & 63u); ++p) {
            add(__ldcg(w.force + __ldg(w.parts + (n[k].shared >> 6) + p)), f[k]);
          }
          if (kPushes) add({push[k].of(0), push[k].of(1), push[k].of(2), 0}, f[k]);
        }
        w.step.move(0, f[k].x, u[k].w, v[k].w, u[k].x, v[k].x);
        w.step.move(1, f[k].y, u[k].w, v[k].w, u[k].y, v[k].y);
        w.step.move(2, f[k].z, u[k].w, v[k].w, u[k].z, v[k].z);
        if (kPushes && push[k].inert != 0) {
          resist(w.pushed, n[k].node, w.step, w.from, u[k], v[k]);
        }
      } else {
        n[k].weight = 0;
      }
      // As in hold_group(): what the velocity at the face lacks.
      const float of_u = h.drift * inv_dt, of_v = 1 - h.drift;
      const float arm = inv_dt * n[k].arm;
      const float x = sum_of_four(arm * m[k].x - n[k].weight * (of_v * v[k].x + of_u * u[k].x)),
                  y = sum_of_four(arm * m[k].y - n[k].weight * (of_v * v[k].y + of_u * u[k].y)),
                  z = sum_of_four(arm * m[k].z - n[k].weight * (of_v * v[k].z + of_u * u[k].z));
      if (n[k].impulse >= 0 && h.impulse != nullptr) {
        const int c = thread % 4;
        atomicAdd(h.impulse + n[k].impulse, static_cast<double>(c == 0 ? x : c == 1 ? y : z));
      }
      if (n[k].local < 0) continue;
      const float dx = n[k].share * x, dy = n[k].share * y, dz = n[k].share * z;
      v[k].x += dx, v[k].y += dy, v[k].z += dz;
      u[k].x += w.step.dt * dx, u[k].y += w.step.dt * dy, u[k].z += w.step.dt * dz;
      put_node(w, n[k].node, n[k].local & (kOwnedHere - 1), (n[k].local & kOwnedHere) != 0, u[k],
               v[k]);
    }
  }
}

}  // namespace tissue_sim
