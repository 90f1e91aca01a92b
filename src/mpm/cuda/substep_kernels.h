// The persistent kernels of substeps.h, with and without contact of tissue with tissue. For .cu
// files.
#pragma once

#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/push_contacts.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

/// Which laws a kernel can do; one that can do all has to hold more registers.
enum class Laws { kFixedCorotated, kNeoHookean, kAny };

/// What a kernel can do beside: nothing (CudaPlan::plain), all but contact of tissue with tissue,
/// or all.
enum class Can { kPlain, kTools, kFaces };

/// Whether a kernel never needs velocities in shared memory.
constexpr bool no_velocities(Laws laws, Can can) {
  return can == Can::kPlain && laws != Laws::kAny;
}

/// The shared memory of a thread block. Worked out anew where it is needed, so that the compiler
/// knows it for shared memory and can use its faster loads.
template <bool kVelocities>
__device__ __forceinline__ BlockShared shared_of(const CudaLayout& layout) {
  extern __shared__ float4 shared[];
  BlockShared s;
  s.u = shared;
  s.v = s.u + (kVelocities ? layout.max_slots : 0);
  s.exchange = s.v + layout.max_slots;
  s.loads = reinterpret_cast<unsigned long long*>(s.exchange + layout.exchange);
  s.colliders = reinterpret_cast<Collider*>(s.loads + 6 * kMaxColliders);
  s.rounds = reinterpret_cast<FaceRounds*>(s.colliders + kMaxColliders);
  return s;
}

template <Laws kLaws, bool kPairs, bool kSpecial, bool kPartial>
__device__ __forceinline__ void forces(const CudaTables& t, const CudaBundle& w, const CudaBlock& b,
                                       const CudaBody& body, const BlockShared& s,
                                       const BlockStep& step) {
  if constexpr (kLaws == Laws::kFixedCorotated) {
    block_forces<FixedCorotated, false, kSpecial, kPartial, kPairs>(t, w, b, body, s, step);
  } else if constexpr (kLaws == Laws::kNeoHookean) {
    block_forces<NeoHookean, false, kSpecial, kPartial, kPairs>(t, w, b, body, s, step);
  } else if (body.neo_hookean != 0) {
    block_forces<NeoHookean, true, kSpecial, kPartial, kPairs>(t, w, b, body, s, step);
  } else {
    block_forces<FixedCorotated, true, kSpecial, kPartial, kPairs>(t, w, b, body, s, step);
  }
}

/// Out of line and with copies of its arguments, for the ordinary blocks to keep theirs in
/// registers.
template <Laws kLaws, bool kPairs, bool kPartial>
__device__ __noinline__ void special_forces(const CudaTables t, const CudaBundle w,
                                            const CudaBlock block, const CudaBody body,
                                            const CudaLayout layout, const BlockStep step) {
  forces<kLaws, kPairs, true, kPartial>(t, w, block, body, shared_of<true>(layout), step);
}

/// A bundle with what belongs to it. Copies: through a reference they would be read again after
/// every store.
struct BundleAtWork {
  CudaBundle bundle;
  CudaBlock block;  ///< the first
  CudaBody body;
  std::uint32_t near;
  __device__ __forceinline__ BundleAtWork(const CudaTables& t, int index)
      : bundle(t.bundles[index]),
        block(t.blocks[bundle.first_block]),
        body(t.bodies[bundle.body]),
        near(0) {
    for (int i = 0; i < bundle.blocks; ++i) near |= t.near[bundle.first_block + i];
  }
};

/// Brings the colliders of a substep to shared memory: the first word of each thread is under way
/// while other things are done.
struct ColliderCopy {
  int words, word;
  __device__ __forceinline__ const int* source(const CudaFrame& f, int substep) const {
    return reinterpret_cast<const int*>(f.colliders + substep * f.collider_count);
  }
  __device__ __forceinline__ ColliderCopy(const CudaFrame& f, std::uint32_t near, int substep)
      : words(near == 0 || substep == f.substeps
                  ? 0
                  : static_cast<int>(sizeof(Collider) / sizeof(int)) * f.collider_count),
        word(0) {
    const int i = static_cast<int>(threadIdx.x);
    if (i < words) word = __ldg(source(f, substep) + i);
  }
  __device__ __forceinline__ void finish(const CudaFrame& f, int substep, Collider* to) const {
    int i = static_cast<int>(threadIdx.x);
    if (i >= words) return;
    int* out = reinterpret_cast<int*>(to);
    out[i] = word;
    while ((i += static_cast<int>(blockDim.x)) < words) out[i] = __ldg(source(f, substep) + i);
  }
};

/// Forces of a bundle whose nodes are there, on its points and between them and the colliders. The
/// exchange is `clear` where the thread block has had no other bundle.
template <Laws kLaws, Can kCan, bool kPairs>
__device__ __forceinline__ void all_forces(const CudaTables& t, const CudaFrame& f,
                                           const BundleAtWork& w, int substep,
                                           const CudaLayout& layout, bool clear, float4* force) {
  const BlockShared s = shared_of<!no_velocities(kLaws, kCan)>(layout);
  const int plane_slots = w.bundle.plane_slots;
  if (!clear) clear_exchange(s.exchange, plane_slots, layout.two_planes);
  if constexpr (kCan == Can::kPlain) {
    __syncthreads();
    forces<kLaws, kPairs, false, false>(t, w.bundle, w.block, w.body, s,
                                        {nullptr, {}, force, layout.two_planes});
    return;
  }
  const int load_count = 6 * f.collider_count;
  if (w.near != 0) {
    for (int i = threadIdx.x; i < load_count; i += blockDim.x) s.loads[i] = 0;
  }
  __syncthreads();
  HalfPush* pushes = f.pushes + blockIdx.x * f.push_stride;
  Touched touched = {};
  if (w.near != 0) {
    touched = find_pushes(t, w.bundle, w.block, w.body, s.u, s.v, s.exchange, s.colliders, w.near,
                          s.loads, pushes, static_cast<int>(threadIdx.x) / (kPairs ? 2 : 1));
    clear_exchange(s.exchange, plane_slots, layout.two_planes);
    __syncthreads();
  }
  const BlockStep step{pushes, touched, force, layout.two_planes};
  if (!touched.any && w.bundle.partial == 0 && w.bundle.blocks == 1) {
    forces<kLaws, kPairs, false, false>(t, w.bundle, w.block, w.body, s, step);
    return;
  }
  if (w.bundle.partial != 0) {
    special_forces<kLaws, kPairs, true>(t, w.bundle, w.block, w.body, layout, step);
  } else {
    special_forces<kLaws, kPairs, false>(t, w.bundle, w.block, w.body, layout, step);
  }
  if (!touched.any) return;
  auto* loads = reinterpret_cast<unsigned long long*>(f.loads) + substep * load_count;
  for (int i = threadIdx.x; i < load_count; i += blockDim.x) {
    if (s.loads[i] != 0) atomicAdd(loads + i, s.loads[i]);
  }
  __syncthreads();
}

/// The forces of contacts that a round reads and clears.
__device__ __forceinline__ PushedNodes pushed_nodes(const CudaFaces& f, int round) {
  return {f.force + f.stride * ((round + 2) % 3), f.force + f.stride * ((round + 1) % 3)};
}

/// One bundle in one round. Each moves all of its nodes on, by the forces of the substep
/// before, whoever else has them too, so that one barrier a substep suffices; then come the forces
/// at their new places. Before the first substep nothing moves, after the last there are no forces.
/// State and forces change places between two buffers. With kFaces, the thread block arrives at the
/// second barrier when its last block's nodes are in place, so that the forces hide the wait for
/// the others.
template <Laws kLaws, bool kCached, bool kPairs, Can kCan>
__device__ __forceinline__ void block_round(const CudaTables& t, const CudaFrame& f,
                                            const BundleAtWork& w, int round,
                                            const CudaLayout& layout, const SlotCache& cache,
                                            bool last) {
  constexpr bool kFaces = kCan == Can::kFaces, kPlain = kCan == Can::kPlain;
  constexpr int kHand = kCached && (kPairs || !kPlain) ? 2 : 4;  // as registers allow
  const BlockShared s = shared_of<!no_velocities(kLaws, kCan)>(layout);
  const float scale = w.body.inv_cell_size;
  float4* v = (!kPlain && w.near != 0) || kLaws == Laws::kAny ? s.v : nullptr;
  // Not f.state[i]: parameters that a register indexes would be copied to local memory.
  const bool odd = ((f.current + max(round - 1, 0)) & 1) != 0, odd_round = (round & 1) != 0;
  const CudaNodes &from = odd ? f.state[1] : f.state[0], &to = odd ? f.state[0] : f.state[1];
  // Their way here takes as long as that of the nodes.
  const ColliderCopy colliders(f, kPlain ? 0 : w.near, round);
  if (round == 0) {
    bring_nodes<false, kCached, kHand>(t, w.bundle.first_slot, w.bundle.slots, cache, from, from,
                                       nullptr, f.step, scale, s.u, v);
  } else {
    PushedNodes pushed;
    if (kFaces) pushed = pushed_nodes(f.faces, round);
    bring_nodes<true, kCached, kHand, kFaces>(t, w.bundle.first_slot, w.bundle.slots, cache, from,
                                              to, odd_round ? f.force[0] : f.force[1], f.step,
                                              scale, s.u, v, pushed);
  }
  if (round == f.substeps) return;
  colliders.finish(f, round, s.colliders);
  if (kFaces && last) arrive(f.arrived + 1);
  all_forces<kLaws, kCan, kPairs>(t, f, w, round, layout, kCached,
                                  odd_round ? f.force[1] : f.force[0]);
}

/// Contacts of tissue with tissue, once all nodes are where the round brought them: a look when it
/// is time to, and their forces. Thread blocks have `met` so often at their second barrier.
__device__ __forceinline__ void push_faces(const CudaFrame& f, int round, FaceRounds& rounds,
                                           unsigned& met) {
  const float dt = f.step.dt;
  if (round == f.substeps) {
    if (blockIdx.x == 0 && threadIdx.x == 0) rounds.end(f.faces, round, dt);
    return;
  }
  wait(f.arrived + 1, ++met);
  const bool odd = ((f.current + round) & 1) != 0;
  const CudaNodes& state = odd ? f.state[1] : f.state[0];
  const CudaLooks& looks = f.faces.looks;
  if (round == rounds.next) {
    look_at_contacts(looks, state, dt, rounds.since_look(round, dt), f.arrived + 1, met);
    met += 2;
    if (threadIdx.x == 0) rounds.looked(f.faces, round, dt);
  }
  push_contacts({looks.active, looks.nodes, looks.springs, &looks.figures->active}, state, dt,
                f.faces.force + f.faces.stride * (round % 3));
}

template <Laws kLaws, bool kCached, bool kPairs, Can kCan>
__global__ void __launch_bounds__(kMaxCudaThreads, 1)
    mpm_substeps(const CudaTables t, const CudaFrame f, const CudaLayout layout) {
  constexpr bool kFaces = kCan == Can::kFaces;
  const BlockShared s = shared_of<!no_velocities(kLaws, kCan)>(layout);
  const int max_slots = layout.max_slots;
  SlotCache cache;
  cache.parts = reinterpret_cast<uint4*>(s.rounds + 1);
  cache.more = layout.eight_parts ? cache.parts + max_slots : nullptr;
  cache.node =
      reinterpret_cast<std::int32_t*>(cache.parts + (layout.eight_parts ? 2 : 1) * max_slots);
  cache.shared = reinterpret_cast<std::uint32_t*>(cache.node + max_slots);
  unsigned met = 0;
  if (kFaces && threadIdx.x == 0) s.rounds->begin(f.faces, f.step.dt);
  if constexpr (kCached) {
    const BundleAtWork mine(t, static_cast<int>(blockIdx.x));
    fill_cache(t, mine.bundle.first_slot, mine.bundle.slots, cache);
    clear_exchange(s.exchange, mine.bundle.plane_slots, layout.two_planes);
    __syncthreads();
    for (int round = 0; round <= f.substeps; ++round) {
      if (round > 0) grid_barrier(f.arrived, static_cast<unsigned>(round));
      block_round<kLaws, true, kPairs, kCan>(t, f, mine, round, layout, cache, true);
      if (kFaces) push_faces(f, round, *s.rounds, met);
    }
  } else {
    for (int round = 0; round <= f.substeps; ++round) {
      if (round > 0) grid_barrier(f.arrived, static_cast<unsigned>(round));
      for (int i = blockIdx.x; i < t.bundle_count; i += gridDim.x) {
        const bool last = i + static_cast<int>(gridDim.x) >= t.bundle_count;
        block_round<kLaws, false, kPairs, kCan>(t, f, BundleAtWork(t, i), round, layout, cache,
                                                last);
        __syncthreads();  // the next one clears the exchange
      }
      if (kFaces) push_faces(f, round, *s.rounds, met);
    }
  }
}

template <Laws kLaws, bool kPairs, Can kCan>
CudaKernel kernel_for(const CudaPlan& plan) {
  return plan.cached ? mpm_substeps<kLaws, true, kPairs, kCan>
                     : mpm_substeps<kLaws, false, kPairs, kCan>;
}
template <Laws kLaws, Can kCan>
CudaKernel kernel_for(const CudaPlan& plan) {
  return plan.small && plan.pairs ? kernel_for<kLaws, true, kCan>(plan)
                                  : kernel_for<kLaws, false, kCan>(plan);
}

/// Small tissues are fastest with two threads to a column of cells, large ones with one, which has
/// less to do in all. Viscosity, and with it kAny, is there for two alone.
template <Can kCan>
CudaKernel kernel_of(const CudaPlan& plan) {
  if (plan.viscous || (plan.neo_hookean && plan.fixed_corotated)) {
    return kernel_for<Laws::kAny, true, kCan>(plan);
  }
  return plan.neo_hookean ? kernel_for<Laws::kNeoHookean, kCan>(plan)
                          : kernel_for<Laws::kFixedCorotated, kCan>(plan);
}

}  // namespace
}  // namespace tissue_sim
