// The persistent kernels of substeps.h, with and without contact and fronts. For .cu files.
#pragma once

#include <type_traits>

#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/push_cells.h"
#include "mpm/cuda/push_contacts.h"
#include "mpm/cuda/push_front.h"
#include "mpm/cuda/shared_work.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

/// Which laws a kernel can do; one that can do all has to hold more registers.
enum class Laws { kFixedCorotated, kNeoHookean, kAny };

/// What a kernel can do: whole and cut tissue, contact with tools beside, or of tissue with tissue
/// too, and with fronts of cuts.
enum class Can { kCuts, kPushes, kTouches, kFronts };
constexpr bool touches(Can can) { return can == Can::kTouches || can == Can::kFronts; }
constexpr bool pushes(Can can) { return can == Can::kPushes || touches(can); }

/// Whether tissue touches tissue: with a front it need not.
template <Can kCan>
__device__ __forceinline__ bool has_faces(const CudaFrame& f) {
  return kCan == Can::kTouches || (kCan == Can::kFronts && f.faces != nullptr);
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

/// Out of line, for the ordinary blocks to keep theirs in registers.
template <Laws kLaws, bool kPairs, bool kPartial>
__device__ __noinline__ void special_forces(float4* force, int workers_first, int workers_count) {
  const SharedWork& work = work_of();
  // Copies: through the pointer they would be read again after every store.
  const CudaTables t = work.tables;
  const CudaBundle w = work.bundle;
  const CudaBlock block = work.block;
  const CudaBody body = work.body;
  const CudaLayout layout = work.layout;
  BlockStep step{force, layout.two_planes, {}};
  step.workers.first = workers_first;
  step.workers.count = workers_count;
  forces<kLaws, kPairs, true, kPartial>(t, w, block, body, shared_of<kLaws == Laws::kAny>(layout),
                                        step);
}

/// Forces of a bundle whose nodes are there. The exchange is `clear` where the thread block has had
/// no other bundle.
template <Laws kLaws, Can kCan, bool kPairs>
__device__ __forceinline__ void all_forces(const CudaTables& t, const BundleAtWork& w,
                                           const CudaLayout& layout, bool clear, float4* force,
                                           const Workers& workers) {
  const BlockShared s = shared_of<kLaws == Laws::kAny>(layout);
  if (!clear) clear_exchange(s.exchange, w.bundle.plane_slots, layout.two_planes);
  if (!pushes(kCan) || !clear) __syncthreads();
  const BlockStep step{force, layout.two_planes, workers};
  // Small tissue waits for instructions as often as it issues them, and those of two ways and of
  // contact are more than the caches of the multiprocessors hold.
  const auto special = [&](const auto& partial) {
    special_forces<kLaws, kPairs, std::decay_t<decltype(partial)>::value>(force, workers.first,
                                                                          workers.count);
  };
  if (touches(kCan) && kPairs && !workers.is_all()) {
    special(std::true_type());
  } else if (w.bundle.partial == 0 && w.bundle.blocks == 1) {
    forces<kLaws, kPairs, false, false>(t, w.bundle, w.block, w.body, s, step);
  } else if (w.bundle.partial != 0) {
    special(std::true_type());
  } else {
    special(std::false_type());
  }
}

/// Thread blocks meet a second time in a round, where all nodes are in place. The last thread
/// arrives, whose warp most often has nothing else to do.
__device__ __forceinline__ void nodes_are_there(const CudaFrame& f) {
  arrive(f.arrived + 1, blockDim.x - 1);
}

/// One bundle in one round. Each moves all of its nodes on, by the forces of the substep
/// before, whoever else has them too, so that one barrier a substep suffices; then come the forces
/// at their new places. Before the first substep nothing moves, after the last there are no forces.
/// State and forces change places between two buffers. With kPushes, the thread block arrives at
/// the second barrier when its last block's nodes are in place, so that the forces hide the wait
/// for the others.
template <Laws kLaws, bool kCached, bool kPairs, Can kCan, class AtWork>
__device__ __forceinline__ void block_round(const CudaTables& t, const CudaFrame& f,
                                            const AtWork& at_work, int round,
                                            const CudaLayout& layout, const Workers& workers,
                                            bool last) {
  constexpr bool kPushes = pushes(kCan);
  constexpr int kHand = kCached ? 2 : 4;  // as registers allow
  const BlockShared s = shared_of<kLaws == Laws::kAny>(layout);
  const SlotCache cache = cache_of(s, layout);
  const BundleAtWork& w = at_work();
  const float scale = placed_scale(w.body);
  float4* v = kLaws == Laws::kAny ? s.v : nullptr;
  // Not f.state[i]: parameters that a register indexes would be copied to local memory.
  const bool odd = ((f.current + max(round - 1, 0)) & 1) != 0, odd_round = (round & 1) != 0;
  const CudaNodes &from = odd ? f.state[1] : f.state[0], &to = odd ? f.state[0] : f.state[1];
  if (round == 0) {
    bring_nodes<false, kCached, kHand>(t, w.bundle.first_slot, w.bundle.slots, cache, from, from,
                                       nullptr, f.step, scale, s.u, v);
  } else {
    PushedNodes pushed = {};
    InertialLoads loads = {};
    if (kPushes) {
      pushed = pushed_nodes(f.pushes, round);
      const int first = (round - 1) * f.collider_count;
      loads = {t.blocks + w.bundle.first_block, w.bundle.blocks, t.bodies, f.colliders + first,
               reinterpret_cast<unsigned long long*>(f.loads) + kLoadSums * first};
    }
    bring_nodes<true, kCached, kHand, kPushes>(t, w.bundle.first_slot, w.bundle.slots, cache, from,
                                               to, odd_round ? f.force[0] : f.force[1], f.step,
                                               scale, s.u, v, pushed, loads);
    if (f.held_faces.chunks != nullptr) {
      __syncthreads();
      hold_bundle<kLaws == Laws::kAny, kPushes>(round);
    }
  }
  if (round == f.substeps) return;
  if (kPushes && last) nodes_are_there(f);
  if (!workers.has_me()) return;
  all_forces<kLaws, kCan, kPairs>(t, at_work(), layout, kCached,
                                  odd_round ? f.force[1] : f.force[0], workers);
}

/// Contact, once all nodes are where the round brought them: of tissue with colliders and of tissue
/// with tissue. Thread blocks have `met` so often at their second barrier. Where there are thread
/// blocks enough without a bundle (`helpers`), colliders are left to them.
template <Can kCan, bool kPairs>
__device__ __forceinline__ void push_nodes(const CudaTables& t, const CudaFrame& f,
                                           const BlockShared& s, int round, const Pushers& pushers,
                                           bool helpers, unsigned& met) {
  constexpr bool kTouches = touches(kCan);
  if (!pushers.has_me()) return;
  const float dt = f.step.dt;
  const int first = helpers ? t.bundle_count : 0, block = static_cast<int>(blockIdx.x) - first;
  if (block < 0 && !kTouches) return;
  const bool odd = ((f.current + round) & 1) != 0;
  const CudaNodes& state = odd ? f.state[1] : f.state[0];
  long long* force = f.pushes.force + f.pushes.stride * (round % 3);
  const auto touch = [&] {
    if constexpr (kTouches) {
      if (!has_faces<kCan>(f)) return;
      touch_faces<!kPairs>(s.rounds, round, dt, state, pushers, f.arrived, force);
    }
  };
  if (kTouches && f.near_cells == nullptr) return touch();
  const int warp = pushers.me() / 32, blocks = static_cast<int>(gridDim.x) - first,
            warps = blocks * pushers.size() / 32;
  const ColliderCopy colliders(f, round, pushers);
  NearSearch near(f, warp * blocks + block, warps);
  colliders.finish(s.colliders);
  wait(f.arrived + 1, ++met, pushers);
  if (f.near_cells != nullptr && block >= 0) {
    auto* loads =
        reinterpret_cast<unsigned long long*>(f.loads) + kLoadSums * f.collider_count * round;
    long long* inertia = f.pushes.inertia;
    if (inertia != nullptr) inertia += f.pushes.inertia_stride * (round % 3);
    near.push<kCan == Can::kFronts>(
        t, state, kCellReach * f.cell_size,
        {s.colliders, loads, force, inertia, dt, f.step.kick, round == 0 ? f.grown : 0},
        s.cells[warp]);
  }
  touch();
}

/// The front's cells push, as nodes are where the round brought them. The last `free` warps of each
/// thread block have a pass each: none where thread blocks without a bundle begin before the
/// others.
__device__ __forceinline__ void push_front_of(const CudaFrame& f, int round, int free) {
  const bool odd = ((f.current + round) & 1) != 0;
  const unsigned number = (blockDim.x - 1 - threadIdx.x) / 32, owned = gridDim.x * free;
  push_front(f.front, odd ? f.state[1] : f.state[0], f.arrived, round,
             number * gridDim.x + blockIdx.x, owned,
             f.pushes.force + f.pushes.stride * (round % 3));
}

template <Laws kLaws, bool kCached, bool kPairs, Can kCan>
__global__ void __launch_bounds__(kMaxCudaThreads, 1)
    mpm_substeps(const CudaTables t, const CudaFrame f, const CudaLayout layout) {
  constexpr bool kPushes = pushes(kCan), kTouches = touches(kCan), kFronts = kCan == Can::kFronts;
  const BlockShared s = shared_of<kLaws == Laws::kAny>(layout);
  const int mine = static_cast<int>(blockIdx.x);
  const bool idle = kPushes && mine >= t.bundle_count;
  // Where columns have one thread, a round is long enough for few to push.
  const bool helpers =
      !kPairs && static_cast<int>(gridDim.x) - t.bundle_count >= kEnoughHelpers && !kTouches;
  // Where some warps have no columns, they push while the others work on forces.
  const bool apart = kPushes && kCached && kPairs && layout.workers < static_cast<int>(blockDim.x);
  Workers workers;
  Pushers pushers;
  if (apart) {
    workers.count = pushers.first = layout.workers;
    pushers.count = static_cast<int>(blockDim.x) - layout.workers;
    if (kFronts) pushers.count -= 32;  // the last warp is there for the front
  }
  const bool for_front = !apart || (idle ? !pushers.has_me() : pushers.me() >= pushers.size());
  const int warps = static_cast<int>(blockDim.x) / 32;
  const int free_for_front = apart ? warps - layout.workers / 32
                             : static_cast<int>(gridDim.x) > t.bundle_count ? 0
                                                                            : warps;
  unsigned met = 0;
  if (has_faces<kCan>(f) && threadIdx.x == 0) {
    s.rounds->begin(t, *f.faces, f.step.dt);
    if (mine == 0) clear_next_turns(f.arrived, 0);
  }
  if (threadIdx.x == 0) work_of().begin(t, f, layout);
  if (kCached && !idle) {
    const BundleAtWork kept(t, mine);
    const HeldOfBundle of(f.held_faces, mine);
    fill_cache(t, kept.bundle.first_slot, kept.bundle.slots, cache_of(s, layout));
    clear_exchange(s.exchange, kept.bundle.plane_slots, layout.two_planes);
    if (threadIdx.x == 0) work_of().take(kept, of, mine);
    fill_held(f.held_faces, of, held_of(s, layout));
    __syncthreads();
  }
  for (int round = 0; round <= f.substeps; ++round) {
    if (round > 0) {
      grid_barrier(f.arrived, static_cast<unsigned>(round), [&] {
        if (kFronts && mine == 0) __stcg(front_turns(f.arrived, round + 1), 0u);
        if (has_faces<kCan>(f)) {
          s.rounds->learn(round, f.step.dt);
          if (mine == 0) clear_next_turns(f.arrived, round);
          if (mine == 0 && round == f.substeps) s.rounds->end(round, f.step.dt);
        }
      });
    }
    if constexpr (kFronts) move_parted(f, t.bundle_count, round, pushed_nodes(f.pushes, round));
    if (idle) {
      if (round < f.substeps) nodes_are_there(f);
    } else if constexpr (kCached) {
      // Read anew where it is needed, for what comes between to have the registers.
      const auto at_work = [&] {
        const SharedWork& work = work_of();
        return BundleAtWork(work.bundle, work.block, work.body);
      };
      block_round<kLaws, true, kPairs, kCan>(t, f, at_work, round, work_of().layout, workers, true);
    } else {
      for (int i = mine; i < t.bundle_count; i += gridDim.x) {
        const bool last = i + static_cast<int>(gridDim.x) >= t.bundle_count;
        const BundleAtWork bundle(t, i);
        if (threadIdx.x == 0) work_of().take(bundle, HeldOfBundle(f.held_faces, i), i);
        __syncthreads();
        block_round<kLaws, false, kPairs, kCan>(t, f, bundle, round, work_of().layout, workers,
                                                last);
        __syncthreads();  // the next one clears the exchange
      }
    }
    if constexpr (kPushes) {
      if (kFronts && round < f.substeps && for_front) push_front_of(f, round, free_for_front);
      if (round < f.substeps)
        push_nodes<kCan, kPairs>(t, f, shared_of<kLaws == Laws::kAny>(work_of().layout), round,
                                 pushers, helpers, met);
      if (kFronts && round < f.substeps && apart && pushers.has_me()) {
        push_front_of(f, round, free_for_front);
      }
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
