#include <cuda_runtime.h>

#include <algorithm>

#include "compute/cuda_check.h"
#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

/// Waits until all thread blocks have come here `round` times; what they wrote is then seen by all.
__device__ __forceinline__ void grid_barrier(unsigned* arrived, unsigned round) {
  __syncthreads();
  if (threadIdx.x == 0) {
    asm volatile("red.release.gpu.global.add.u32 [%0], 1;" ::"l"(arrived) : "memory");
    const unsigned wanted = round * gridDim.x;
    unsigned seen;
    do {
      asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(seen) : "l"(arrived) : "memory");
    } while (seen < wanted);
  }
  __syncthreads();
}

/// The shared memory of a thread block. Worked out anew where it is needed, so that the compiler
/// knows it for shared memory and can use its faster loads.
__device__ __forceinline__ BlockShared shared_of(int max_slots) {
  extern __shared__ float4 shared[];
  BlockShared s;
  s.u = shared;
  s.v = s.u + max_slots;
  s.exchange = s.v + max_slots;
  s.loads = reinterpret_cast<unsigned long long*>(s.exchange + 9 * blockDim.x);
  return s;
}

/// Which laws a kernel can do; one that can do all has to hold more registers.
enum class Laws { kFixedCorotated, kNeoHookean, kAny };

template <Laws kLaws, bool kSpecial>
__device__ __forceinline__ void forces(const CudaTables& t, const CudaBlock& b,
                                       const CudaBody& body, const BlockShared& s,
                                       const BlockStep& step) {
  if constexpr (kLaws == Laws::kFixedCorotated) {
    block_forces<FixedCorotated, false, kSpecial>(t, b, body, s, step);
  } else if constexpr (kLaws == Laws::kNeoHookean) {
    block_forces<NeoHookean, false, kSpecial>(t, b, body, s, step);
  } else if (body.neo_hookean != 0) {
    block_forces<NeoHookean, true, kSpecial>(t, b, body, s, step);
  } else {
    block_forces<FixedCorotated, true, kSpecial>(t, b, body, s, step);
  }
}

/// Out of line and with copies of its arguments, for the ordinary blocks to keep theirs in
/// registers.
template <Laws kLaws>
__device__ __noinline__ void special_forces(const CudaTables t, const CudaBlock b,
                                            const CudaBody body, int max_slots,
                                            const BlockStep step) {
  forces<kLaws, true>(t, b, body, shared_of(max_slots), step);
}

/// A block with what belongs to it. Copies: through a reference they would be read again after
/// every store.
struct BlockAtWork {
  CudaBlock block;
  CudaBody body;
  std::uint32_t near;
  __device__ __forceinline__ BlockAtWork(const CudaTables& t, int index)
      : block(t.blocks[index]), body(t.bodies[block.body]), near(t.near[index]) {}
};

/// Forces of a block whose nodes are there, on its points and between them and the colliders.
template <Laws kLaws>
__device__ __forceinline__ void all_forces(const CudaTables& t, const CudaFrame& f,
                                           const BlockAtWork& w, int substep, int max_slots,
                                           float4* force) {
  const BlockShared s = shared_of(max_slots);
  const int load_count = 6 * f.collider_count;
  if (w.near != 0) {
    for (int i = threadIdx.x; i < load_count; i += blockDim.x) s.loads[i] = 0;
  }
  __syncthreads();
  const BlockStep step{f.colliders + substep * f.collider_count, w.near, force};
  if (w.near == 0 && w.block.partial == 0) {
    forces<kLaws, false>(t, w.block, w.body, s, step);
    return;
  }
  special_forces<kLaws>(t, w.block, w.body, max_slots, step);
  if (w.near == 0) return;
  auto* loads = reinterpret_cast<unsigned long long*>(f.loads) + substep * load_count;
  for (int i = threadIdx.x; i < load_count; i += blockDim.x) {
    if (s.loads[i] != 0) atomicAdd(loads + i, s.loads[i]);
  }
  __syncthreads();
}

/// One block in one round. Each block moves all of its nodes on, by the forces of the substep
/// before, whoever else has them too, so that one barrier a substep suffices; then come the forces
/// at their new places. Before the first substep nothing moves, after the last there are no forces.
/// State and forces change places between two buffers.
template <Laws kLaws, bool kCached>
__device__ __forceinline__ void block_round(const CudaTables& t, const CudaFrame& f,
                                            const BlockAtWork& w, int round, int max_slots,
                                            const SlotCache& cache) {
  const BlockShared s = shared_of(max_slots);
  const float scale = w.body.inv_cell_size;
  float4* v = w.near != 0 || kLaws == Laws::kAny ? s.v : nullptr;
  // Not f.state[i]: parameters that a register indexes would be copied to local memory.
  const bool odd = ((f.current + max(round - 1, 0)) & 1) != 0, odd_round = (round & 1) != 0;
  const CudaNodes &from = odd ? f.state[1] : f.state[0], &to = odd ? f.state[0] : f.state[1];
  if (round == 0) {
    bring_nodes<false, kCached>(t, w.block, cache, from, from, nullptr, f.step, scale, s.u, v);
  } else {
    bring_nodes<true, kCached>(t, w.block, cache, from, to, odd_round ? f.force[0] : f.force[1],
                               f.step, scale, s.u, v);
  }
  if (round == f.substeps) return;
  all_forces<kLaws>(t, f, w, round, max_slots, odd_round ? f.force[1] : f.force[0]);
}

template <Laws kLaws, bool kCached, int kThreads, int kBlocksPerProcessor>
__global__ void __launch_bounds__(kThreads, kBlocksPerProcessor)
    mpm_substeps(const CudaTables t, const CudaFrame f, int max_slots) {
  const BlockShared s = shared_of(max_slots);
  SlotCache cache;
  cache.parts = reinterpret_cast<uint4*>(s.loads + 6 * kMaxColliders);
  cache.node = reinterpret_cast<std::int32_t*>(cache.parts + max_slots);
  cache.shared = reinterpret_cast<std::uint32_t*>(cache.node + max_slots);
  if constexpr (kCached) {
    const BlockAtWork mine(t, static_cast<int>(blockIdx.x));
    fill_cache(t, mine.block, cache);
    __syncthreads();
    for (int round = 0; round <= f.substeps; ++round) {
      if (round > 0) grid_barrier(f.arrived, static_cast<unsigned>(round));
      block_round<kLaws, true>(t, f, mine, round, max_slots, cache);
    }
  } else {
    for (int round = 0; round <= f.substeps; ++round) {
      if (round > 0) grid_barrier(f.arrived, static_cast<unsigned>(round));
      for (int i = blockIdx.x; i < t.block_count; i += gridDim.x) {
        block_round<kLaws, false>(t, f, BlockAtWork(t, i), round, max_slots, cache);
      }
    }
  }
}

using Kernel = void (*)(CudaTables, CudaFrame, int);

template <bool kCached, int kThreads, int kAtOnce>
Kernel kernel_for(const CudaPlan& plan) {
  if (plan.viscous || (plan.neo_hookean && plan.fixed_corotated)) {
    return mpm_substeps<Laws::kAny, kCached, kMaxCudaThreads, 1>;
  }
  return plan.neo_hookean ? mpm_substeps<Laws::kNeoHookean, kCached, kThreads, kAtOnce>
                          : mpm_substeps<Laws::kFixedCorotated, kCached, kThreads, kAtOnce>;
}

/// The kernel of small tissues has all registers for each thread; that of large ones holds so few
/// that 384 threads run at once, of which some compute while others wait for memory.
Kernel kernel_of(const CudaPlan& plan) {
  if (plan.cached) return kernel_for<true, kMaxCudaThreads, 1>(plan);
  return plan.threads > 192 ? kernel_for<false, kMaxCudaThreads, 1>(plan)
                            : kernel_for<false, 192, 2>(plan);
}

std::size_t shared_bytes(const CudaPlan& plan) {
  const std::size_t of_slot = 2 * sizeof(float4) + (plan.cached ? sizeof(uint4) + 8 : 0);
  return of_slot * plan.max_slots + 9 * sizeof(float4) * plan.threads +
         6 * kMaxColliders * sizeof(long long);
}

int attribute(cudaDeviceAttr which) {
  int device = 0, value = 0;
  check_cuda(cudaGetDevice(&device), "be asked");
  check_cuda(cudaDeviceGetAttribute(&value, which, device), "be asked");
  return value;
}

int resident_of(const CudaPlan& plan) {
  const std::size_t bytes = shared_bytes(plan);
  if (bytes > static_cast<std::size_t>(attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin))) {
    return 0;
  }
  const auto kernel = reinterpret_cast<const void*>(kernel_of(plan));
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                  static_cast<int>(bytes)),
             "be set up");
  int each = 0;
  check_cuda(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, plan.threads, bytes),
             "be asked");
  return each * attribute(cudaDevAttrMultiProcessorCount);
}

}  // namespace

int resident_blocks(CudaPlan& plan, int block_count) {
  plan.cached = plan.small;
  if (plan.cached) {
    const int resident = resident_of(plan);
    if (resident >= block_count) return resident;
    plan.cached = false;
  }
  return resident_of(plan);
}

void launch_substeps(const CudaPlan& plan, const CudaTables& tables, const CudaFrame& frame,
                     int resident, cudaStream_t stream) {
  CudaTables t = tables;
  CudaFrame f = frame;
  int max_slots = plan.max_slots;
  void* arguments[] = {&t, &f, &max_slots};
  check_cuda(cudaMemsetAsync(f.arrived, 0, sizeof(unsigned), stream), "clear memory");
  check_cuda(cudaLaunchCooperativeKernel(reinterpret_cast<const void*>(kernel_of(plan)),
                                         dim3(std::min(resident, t.block_count)),
                                         dim3(plan.threads), arguments, shared_bytes(plan), stream),
             "start the substeps");
}

}  // namespace tissue_sim
