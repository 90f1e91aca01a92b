#include <cuda_runtime.h>

#include <algorithm>

#include "compute/cuda_check.h"
#include "mpm/cuda/block_forces.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {
namespace {

constexpr int kMaxThreads = 256;

/// Waits until all thread blocks have come here `round` times; what they wrote is then seen by all.
__device__ __forceinline__ void grid_barrier(unsigned* arrived, unsigned round) {
  __syncthreads();
  if (threadIdx.x == 0) {
    __threadfence();
    atomicAdd(arrived, 1u);
    const unsigned wanted = round * gridDim.x;
    unsigned seen;
    do {
      asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(seen) : "l"(arrived) : "memory");
    } while (seen < wanted);
    __threadfence();
  }
  __syncthreads();
}

/// Which laws a kernel can do; one that can do all has to hold more registers.
enum class Laws { kFixedCorotated, kNeoHookean, kAny };

template <Laws kLaws, bool kSpecial, int kParts>
__device__ __forceinline__ void forces(const CudaTables& t, const CudaBlock& b,
                                       const CudaBody& body, const BlockShared& s,
                                       const BlockStep& step) {
  if constexpr (kLaws == Laws::kFixedCorotated) {
    block_forces<FixedCorotated, false, kSpecial, kParts>(t, b, body, s, step);
  } else if constexpr (kLaws == Laws::kNeoHookean) {
    block_forces<NeoHookean, false, kSpecial, kParts>(t, b, body, s, step);
  } else if (body.neo_hookean != 0) {
    block_forces<NeoHookean, true, kSpecial, kParts>(t, b, body, s, step);
  } else {
    block_forces<FixedCorotated, true, kSpecial, kParts>(t, b, body, s, step);
  }
}

/// One block in one substep: the nodes move on by the forces of the substep before, then the forces
/// at their new places. Before the first substep nothing moves, after the last there are no forces.
template <Laws kLaws, int kParts>
__device__ __forceinline__ void block_substep(const CudaTables& t, const CudaFrame& f, int index,
                                              int round, const BlockShared& s) {
  // Copies: through a reference they would be read again after every store.
  const CudaBlock b = t.blocks[index];
  const CudaBody body = t.bodies[b.body];
  const std::uint32_t near = t.near[index];
  const int from = (f.current + max(round - 1, 0)) & 1;
  float4* v = near != 0 || kLaws == Laws::kAny ? s.v : nullptr;
  if (round == 0) {
    bring_nodes<false>(t, b, f.state[from], f.state[from], nullptr, f.step, body.inv_cell_size, s.u,
                       v);
  } else {
    bring_nodes<true>(t, b, f.state[from], f.state[from ^ 1], f.force[(round - 1) & 1], f.step,
                      body.inv_cell_size, s.u, v);
  }
  const int load_count = 6 * f.collider_count;
  if (near != 0) {
    for (int i = threadIdx.x; i < load_count; i += blockDim.x) s.loads[i] = 0;
  }
  __syncthreads();
  if (round == f.substeps) return;
  const BlockStep step{f.colliders + round * f.collider_count, near, f.force[round & 1]};
  if (near == 0 && b.partial == 0) {
    forces<kLaws, false, kParts>(t, b, body, s, step);
    return;
  }
  forces<kLaws, true, kParts>(t, b, body, s, step);
  if (near == 0) return;
  auto* loads = reinterpret_cast<unsigned long long*>(f.loads) + round * load_count;
  for (int i = threadIdx.x; i < load_count; i += blockDim.x) {
    if (s.loads[i] != 0) atomicAdd(loads + i, s.loads[i]);
  }
  __syncthreads();
}

template <Laws kLaws, int kParts, int kThreads, int kBlocksPerProcessor>
__global__ void __launch_bounds__(kThreads, kBlocksPerProcessor)
    mpm_substeps(const CudaTables t, const CudaFrame f, int max_slots) {
  extern __shared__ float4 shared[];
  BlockShared s;
  s.u = shared;
  s.v = s.u + max_slots;
  s.exchange = s.v + max_slots;
  s.loads = reinterpret_cast<unsigned long long*>(s.exchange + 9 * blockDim.x);
  for (int round = 0; round <= f.substeps; ++round) {
    if (round > 0) grid_barrier(f.arrived, static_cast<unsigned>(round));
    for (int i = blockIdx.x; i < t.block_count; i += gridDim.x) {
      block_substep<kLaws, kParts>(t, f, i, round, s);
    }
  }
}

using Kernel = void (*)(CudaTables, CudaFrame, int);

template <int kParts, int kThreads, int kBlocksPerProcessor>
Kernel kernel_of(const CudaPlan& plan) {
  if (plan.viscous || (plan.neo_hookean && plan.fixed_corotated)) {
    return mpm_substeps<Laws::kAny, kParts, kThreads, 1>;
  }
  return plan.neo_hookean
             ? mpm_substeps<Laws::kNeoHookean, kParts, kThreads, kBlocksPerProcessor>
             : mpm_substeps<Laws::kFixedCorotated, kParts, kThreads, kBlocksPerProcessor>;
}

/// More registers for each thread where there are few of them.
Kernel kernel_of(const CudaPlan& plan) {
  if (plan.parts == 2) return kernel_of<2, kMaxThreads, 1>(plan);
  return kernel_of<1, 128, 3>(plan);
}

std::size_t shared_bytes(const CudaPlan& plan) {
  return sizeof(float4) * (2 * static_cast<std::size_t>(plan.max_slots) + 9 * plan.threads) +
         6 * kMaxColliders * sizeof(long long);
}

}  // namespace

int resident_blocks(const CudaPlan& plan) {
  int device = 0, processors = 0, most = 0, each = 0;
  check_cuda(cudaGetDevice(&device), "be asked");
  check_cuda(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device),
             "be asked");
  check_cuda(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, device),
             "be asked");
  if (shared_bytes(plan) > static_cast<std::size_t>(most)) return 0;
  const auto kernel = reinterpret_cast<const void*>(kernel_of(plan));
  const auto bytes = static_cast<int>(shared_bytes(plan));
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, bytes),
             "be set up");
  check_cuda(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, plan.threads, bytes),
             "be asked");
  return each * processors;
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
