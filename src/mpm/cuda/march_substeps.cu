// The kernels of large tissue that is whole and away from all tools: nodes come plane by plane.
#include <type_traits>

#include "mpm/cuda/grid_barrier.h"
#include "mpm/cuda/march.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

/// As mpm_substeps() in substep_kernels.h. What the tables say of the next block's lowest planes is
/// on its way before the barrier.
template <class LawOf>
__global__ void __launch_bounds__(kMaxCudaThreads, 1)
    mpm_march(const CudaTables t, const CudaFrame f, const CudaLayout layout) {
  extern __shared__ float4 shared[];
  BlockShared s = {};
  s.u = shared;
  s.exchange = shared + layout.node_room;
  PlaneBarrier barrier(reinterpret_cast<std::uint64_t*>(s.exchange + layout.exchange));
  const int mine = static_cast<int>(blockIdx.x), all = static_cast<int>(gridDim.x);
  // Copies: through a reference they would be read again after every store.
  CudaBlock block = {};
  CudaBody body = {};
  const auto planes = [&](const auto& known) {
    return MovingPlanes<std::decay_t<decltype(known)>>(t, f, block, placed_scale(body), shared,
                                                       known);
  };
  const auto any = [&] {
    return AnyBlock{block.nx, block.ny, static_cast<int>(blockDim.x), layout.max_plane_slots};
  };
  const auto take = [&](int bundle, bool marches) {
    block = t.blocks[t.bundles[bundle].first_block];
    body = t.bodies[block.body];
    if (marches) planes(any()).expect();
  };
  int cleared_nx = 0, cleared_ny = 0;  // blocks of this size find the exchange clear
  take(mine, true);
  __syncthreads();
  for (int round = 0;; ++round) {
    const bool marches = round < f.substeps;
    const bool odd = ((f.current + max(round - 1, 0)) & 1) != 0, odd_round = (round & 1) != 0;
    for (int i = mine;;) {
      if (block.nx != cleared_nx || block.ny != cleared_ny) {
        clear_exchange(s.exchange, (block.nx + 2) * (block.ny + 2), true);
        cleared_nx = block.nx;
        cleared_ny = block.ny;
      }
      if (marches) {
        float4* force = odd_round ? f.force[1] : f.force[0];
        if (KnownBlock::is(block, layout.max_plane_slots)) {
          const KnownBlock known;
          march<LawOf>(t, block, body, s, round, force, planes(known), known, barrier);
        } else {
          const AnyBlock known = any();
          march<LawOf>(t, block, body, s, round, force, planes(known), known, barrier);
        }
      } else {
        const CudaNodes &from = odd ? f.state[1] : f.state[0], &to = odd ? f.state[0] : f.state[1];
        bring_nodes<true, false, 4>(t, block.first_slot, block.slots(), {}, from, to,
                                    odd_round ? f.force[0] : f.force[1], f.step, 1, nullptr,
                                    nullptr);
      }
      i += all;
      if (i >= t.bundle_count) break;
      __syncthreads();  // the next one takes the place of this one
      take(i, marches);
    }
    if (!marches) return;
    arrive(f.arrived);
    take(mine, round + 1 < f.substeps);
    wait(f.arrived, static_cast<unsigned>(round + 1));
  }
}

}  // namespace

CudaKernel marching_kernel(const CudaPlan& plan) {
  return plan.neo_hookean ? mpm_march<NeoHookean> : mpm_march<FixedCorotated>;
}

}  // namespace tissue_sim
