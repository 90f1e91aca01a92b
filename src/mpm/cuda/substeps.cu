#include <cuda_runtime.h>

#include <algorithm>

#include "compute/cuda_check.h"
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {
namespace {

const void* kernel(const CudaPlan& plan) {
  return reinterpret_cast<const void*>(plan.faces ? kernel_with_faces(plan)
                                                  : kernel_of<false>(plan));
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
  const int most = attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin);
  if (bytes > static_cast<std::size_t>(most)) return 0;
  const void* of_plan = kernel(plan);
  // As much as there is, for another tissue may want another size of the same kernel.
  check_cuda(cudaFuncSetAttribute(of_plan, cudaFuncAttributeMaxDynamicSharedMemorySize, most),
             "be set up");
  int each = 0;
  check_cuda(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, of_plan, plan.threads, bytes),
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
  check_cuda(cudaMemsetAsync(f.arrived, 0, 2 * sizeof(unsigned), stream), "clear memory");
  check_cuda(cudaLaunchCooperativeKernel(kernel(plan), dim3(std::min(resident, t.block_count)),
                                         dim3(plan.threads), arguments, shared_bytes(plan), stream),
             "start the substeps");
}

}  // namespace tissue_sim
