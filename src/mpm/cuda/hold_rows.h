// Holds rows of anchors' faces that have no nodes in common with others. For .cu files.
#pragma once

#include "mpm/cuda/block_nodes.h"

namespace tissue_sim {

/// What a launch says of held faces and of nodes, in shared memory: handed to a function that is
/// not inlined, all threads would put it into their local memory, thousands of cycles of it.
struct HeldFrame {
  CudaHeldFaces faces;
  const std::uint32_t* parts;  ///< CudaTables::parts
  const std::int32_t* slot_node;
  CudaNodes state[2];
  const float4* force[2];
  NodeStep step;
  NodePushes pushes;
  int current, substeps;
};

/// Where a bundle's nodes come to: divided by `scale`; `v` may be null.
struct BundleNodes {
  float4 *u, *v;
  float scale;
};

/// What holding a bundle's faces needs beside CudaHeldFaces in a round.
struct FacesAtWork {
  const std::uint32_t* parts;
  CudaNodes from, to;
  const float4* force;
  NodeStep step;
  BundleNodes nodes;
  PushedNodes pushed;
  int substep;
  bool last;  ///< substep of the launch

  __device__ __forceinline__ FacesAtWork(const HeldFrame& f, int round, const BundleNodes& n)
      : parts(f.parts),
        from(f.state[(f.current + round + 1) & 1]),
        to(f.state[(f.current + round) & 1]),
        force(f.force[(round + 1) & 1]),
        step(f.step),
        nodes(n),
        pushed(pushed_nodes(f.pushes, round)),
        substep(round - 1),
        last(round == f.substeps) {}
};

/// Puts a slot's node where it is, in the bundle and, where it is the bundle's to write, in memory.
__device__ __forceinline__ void put_node(const FacesAtWork& w, std::int32_t node, int local,
                                         bool owned, const float4& u, const float4& v) {
  const float scale = w.nodes.scale;
  w.nodes.u[local] = {scale * u.x, scale * u.y, scale * u.z, 0};
  if (w.nodes.v != nullptr) w.nodes.v[local] = {scale * v.x, scale * v.y, scale * v.z, 0};
  if (!owned) return;
  __stcg(w.to.u + node, u);
  __stcg(w.to.v + node, v);
}

/// What faces hold of a bundle.
struct alignas(16) HeldOfBundle {
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

/// CudaHeldFaces::held of a bundle in shared memory: by the four words of its nodes, then by node.
struct HeldCache {
  uint4* word;
  int room;  ///< nodes
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

/// A node and what acts on it, on their way from memory; and where it goes were it free, by the
/// sums of bring_nodes().
template <bool kPushes>
struct FreeNode {
  float4 u, v, f, more[7];
  Pushed push;

  /// `Node`: CudaHeldNode or CudaFaceEntry; where it is none, all is zero.
  template <class Node>
  __device__ __forceinline__ void send_for(const FacesAtWork& w, const Node& n) {
    u = v = f = {0, 0, 0, 0};
#pragma unroll
    for (float4& p : more) p = {0, 0, 0, 0};
    push.inert = 0;
    if (n.node < 0) return;
    u = __ldcg(w.from.u + n.node);
    v = __ldcg(w.from.v + n.node);
    if (n.shared == kNoSlot) return;
    const std::uint32_t parts = n.shared & 63u;
    f = __ldcg(w.force + n.parts.x);
    if (parts > 1) more[0] = __ldcg(w.force + n.parts.y);
    if (parts > 2) more[1] = __ldcg(w.force + n.parts.z);
    if (parts > 3) more[2] = __ldcg(w.force + n.parts.w);
    if (parts > 4) more[3] = __ldcg(w.force + n.more.x);
    if (parts > 5) more[4] = __ldcg(w.force + n.more.y);
    if (parts > 6) more[5] = __ldcg(w.force + n.more.z);
    if (parts > 7) more[6] = __ldcg(w.force + n.more.w);
    if (kPushes) push = Pushed(w.pushed, true, false, n.node);
  }
  template <class Node>
  __device__ __forceinline__ void move(const FacesAtWork& w, const Node& n) {
    if (n.node < 0) return;
    if (n.shared != kNoSlot) {
      for (const float4& p : more) add(p, f);
      for (std::uint32_t p = 8; p < (n.shared & 63u); ++p) {
        add(__ldcg(w.force + __ldg(w.parts + (n.shared >> 6) + p)), f);
      }
      if (kPushes) add({push.of(0), push.of(1), push.of(2), 0}, f);
    }
    w.step.move(0, f.x, u.w, v.w, u.x, v.x);
    w.step.move(1, f.y, u.w, v.w, u.y, v.y);
    w.step.move(2, f.z, u.w, v.w, u.z, v.z);
    if (kPushes && push.inert != 0) resist(w.pushed, n.node, w.step, w.from, u, v);
  }
};

/// As calm_swings() of mpm/contact/contact_inertia.h.
__device__ __forceinline__ void calm_swing(float loss, float dt, float4& u, float4& v) {
  const float x = loss * v.x, y = loss * v.y, z = loss * v.z;
  v.x -= x, v.y -= y, v.z -= z;
  u.x -= dt * x, u.y -= dt * y, u.z -= dt * z;
}

/// The sum over four lanes side by side, for all of them.
__device__ __forceinline__ float sum_of_four(float x) {
  x += __shfl_xor_sync(0xffffffffu, x, 1);
  return x + __shfl_xor_sync(0xffffffffu, x, 2);
}

/// Moves the nodes of the bundle's rows on as bring_nodes() would, and holds the rows: each by four
/// lanes, who share nothing with others, so nobody waits. All bundles that have nodes of a row work
/// it out alike.
template <bool kPushes>
__device__ __forceinline__ void hold_rows(const HeldFrame& frame, int round,
                                          const BundleNodes& nodes, int first, int count,
                                          const HeldCache& cache) {
  constexpr int kHand = 2;
  const CudaHeldFaces h = frame.faces;
  const FacesAtWork w(frame, round, nodes);
  const bool cached = count <= cache.room;
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const float inv_dt = 1 / w.step.dt;
  const float4* const pull =
      h.pull == nullptr ? nullptr : h.pull + 4 * static_cast<std::size_t>(w.substep) * h.anchors;
  // What the next substep reads for the first time comes from afar.
  if (pull != nullptr && !w.last && thread < h.anchors) {
    asm volatile("prefetch.global.L2 [%0];" ::"l"(pull + 4 * (h.anchors + thread)));
  }
  for (int i = thread; i - thread % 32 < count; i += kHand * threads) {
    CudaHeldNode n[kHand];
    float4 m[kHand] = {};
    bool swings[kHand];
    FreeNode<kPushes> free[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int at = i + k * threads;
      n[k] = load_held(h.held + first, cache, cached, min(at, count - 1));
      swings[k] = (n[k].anchor & kSwings) != 0;
      if (pull != nullptr) m[k] = __ldg(pull + 4 * (n[k].anchor & (kSwings - 1)) + thread % 4);
      if (at >= count) {
        n[k].node = n[k].local = n[k].impulse = -1;
        n[k].arm = 0;
      }
      if (n[k].node < 0) n[k].weight = 0;
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) free[k].send_for(w, n[k]);
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      free[k].move(w, n[k]);
      float4 &u = free[k].u, &v = free[k].v;
      if (swings[k]) calm_swing(h.swing_loss, w.step.dt, u, v);
      // As in hold_group(): what the velocity at the face lacks.
      const float of_u = h.drift * inv_dt, of_v = 1 - h.drift;
      const float arm = inv_dt * n[k].arm;
      const float x = sum_of_four(arm * m[k].x - n[k].weight * (of_v * v.x + of_u * u.x)),
                  y = sum_of_four(arm * m[k].y - n[k].weight * (of_v * v.y + of_u * u.y)),
                  z = sum_of_four(arm * m[k].z - n[k].weight * (of_v * v.z + of_u * u.z));
      if (n[k].impulse >= 0 && h.impulse != nullptr) {
        const int c = thread % 4;
        atomicAdd(h.impulse + n[k].impulse, static_cast<double>(c == 0 ? x : c == 1 ? y : z));
      }
      if (n[k].local < 0) continue;
      const float dx = n[k].share * x, dy = n[k].share * y, dz = n[k].share * z;
      v.x += dx, v.y += dy, v.z += dz;
      u.x += w.step.dt * dx, u.y += w.step.dt * dy, u.z += w.step.dt * dz;
      put_node(w, n[k].node, n[k].local & (kOwnedHere - 1), (n[k].local & kOwnedHere) != 0, u, v);
    }
  }
}

}  // namespace tissue_sim
