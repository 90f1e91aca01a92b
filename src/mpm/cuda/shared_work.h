// How a thread block's shared memory is laid out, and what functions that are not inlined find
// there. For .cu files.
#pragma once

#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/hold_faces.h"
#include "mpm/cuda/push_cells.h"
#include "mpm/cuda/push_contacts.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

/// A bundle with what belongs to it. Copies: through a reference they would be read again after
/// every store.
struct BundleAtWork {
  CudaBundle bundle;
  CudaBlock block;  ///< the first
  CudaBody body;
  __device__ __forceinline__ BundleAtWork(const CudaTables& t, int index)
      : bundle(t.bundles[index]),
        block(t.blocks[bundle.first_block]),
        body(t.bodies[bundle.body]) {}
  __device__ __forceinline__ BundleAtWork(const CudaBundle& w, const CudaBlock& first,
                                          const CudaBody& of)
      : bundle(w), block(first), body(of) {}
  __device__ __forceinline__ const BundleAtWork& operator()() const { return *this; }
};

/// What functions that are not inlined need, in shared memory: see HeldFrame.
struct alignas(16) SharedWork {
  HeldOfBundle held;
  HeldFrame frame;
  CudaTables tables;
  CudaLayout layout;
  CudaBundle bundle;
  CudaBlock block;
  CudaBody body;
  int index;  ///< of the bundle

  __device__ __forceinline__ void begin(const CudaTables& t, const CudaFrame& f,
                                        const CudaLayout& l) {
    tables = t;
    layout = l;
    frame.faces = f.held_faces;
    frame.parts = t.parts;
    frame.slot_node = t.slot_node;
    frame.state[0] = f.state[0];
    frame.state[1] = f.state[1];
    frame.force[0] = f.force[0];
    frame.force[1] = f.force[1];
    frame.step = f.step;
    frame.pushes = f.pushes;
    frame.current = f.current;
    frame.substeps = f.substeps;
  }
  __device__ __forceinline__ void take(const BundleAtWork& w, const HeldOfBundle& of, int number) {
    bundle = w.bundle;
    block = w.block;
    body = w.body;
    held = of;
    index = number;
  }
};
__device__ __forceinline__ SharedWork& work_of() {
  extern __shared__ float4 shared[];
  return *reinterpret_cast<SharedWork*>(shared);
}
/// The shared memory of a thread block. Worked out anew where it is needed, so that the compiler
/// knows it for shared memory and can use its faster loads.
template <bool kVelocities>
__device__ __forceinline__ BlockShared shared_of(const CudaLayout& layout) {
  extern __shared__ float4 shared[];
  BlockShared s;
  s.u = shared + sizeof(SharedWork) / sizeof(float4);
  s.v = s.u + (kVelocities ? layout.max_slots : 0);
  s.exchange = s.u + layout.node_room;
  s.colliders = reinterpret_cast<Collider*>(s.exchange + layout.exchange);
  s.rounds = reinterpret_cast<FaceRounds*>(s.colliders + kMaxColliders);
  s.cells = reinterpret_cast<WarpNodes*>(s.u + layout.cells);
  return s;
}

/// The room behind all of that.
__device__ __forceinline__ HeldCache held_of(const BlockShared& s, const CudaLayout& layout) {
  return {reinterpret_cast<uint4*>(s.rounds + 1), layout.held};
}

/// The bundle's tables there.
__device__ __forceinline__ SlotCache cache_of(const BlockShared& s, const CudaLayout& layout) {
  SlotCache cache;
  cache.parts = held_of(s, layout).word + 4 * layout.held;
  cache.more = layout.eight_parts ? cache.parts + layout.max_slots : nullptr;
  cache.node = reinterpret_cast<std::int32_t*>(cache.parts +
                                               (layout.eight_parts ? 2 : 1) * layout.max_slots);
  cache.shared = reinterpret_cast<std::uint32_t*>(cache.node + layout.max_slots);
  return cache;
}

/// After bring_nodes(): what faces hold of a bundle. All threads of the block. Out of line and with
/// all but the round in shared memory, for scenes without anchors to keep their registers.
template <bool kVelocities, bool kPushes>
__device__ __noinline__ void hold_bundle(int round) {
  const SharedWork& work = work_of();
  const CudaLayout layout = work.layout;
  const BlockShared s = shared_of<kVelocities>(layout);
  const HeldOfBundle of = work.held;
  const BundleNodes nodes{s.u, kVelocities ? s.v : nullptr, placed_scale(work.body)};
  if (of.count > 0) {
    hold_rows<kPushes>(work.frame, round, nodes, of.first, of.count, held_of(s, layout));
  }
  if (of.grouped ||
      (of.carries && (round == work.frame.substeps || work.frame.faces.carries_always))) {
    hold_faces<kPushes>(work.frame, round, nodes, work.index, s.exchange);
  }
}

}  // namespace
}  // namespace tissue_sim
