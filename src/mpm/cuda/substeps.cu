#include <cuda_runtime.h>

#include <algorithm>

#include "compute/cuda_check.h"
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {
namespace {

const void* kernel(const CudaPlan& plan) {
  return reinterpret_cast<const void*>(plan.faces   ? kernel_with_faces(plan)
                                       : plan.plain ? plain_kernel(plan)
                                                    : kernel_of<Can::kTools>(plan));
}

std::size_t shared_bytes(const CudaPlan& plan) {
  const std::size_t of_slot = 2 * sizeof(float4) + (plan.cached ? sizeof(uint4) + 8 : 0) +
                              (plan.eight_parts ? sizeof(uint4) : 0);
  return of_slot * plan.max_slots + 9 * sizeof(float4) * plan.threads +
         kMaxColliders * (6 * sizeof(long long) + sizeof(Collider)) + sizeof(FaceRounds);
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
  for (const bool eight : {true, false}) {
    plan.cached = plan.small;
    plan.eight_parts = plan.small && eight;
    if (!plan.cached) break;
    const int resident = resident_of(plan);
    if (resident >= block_count) return resident;
  }
  plan.cached = plan.eight_parts = false;
  return resident_of(plan);
}

int most_at_once(const CudaPlan& plan) {
  CudaPlan most = plan;
  most.cached = plan.small;
  most.eight_parts = false;
  return resident_of(most);
}

int most_slots(const CudaPlan& plan) {
  CudaPlan larger = plan;
  const int resident = most_at_once(plan), step = 64;
  while (resident > 0 && most_at_once(larger) == resident) larger.max_slots += step;
  return std::max(plan.max_slots, larger.max_slots - step);
}

void launch_substeps(const CudaPlan& plan, const CudaTables& tables, const CudaFrame& frame,
                     int resident, cudaStream_t stream) {
  CudaTables t = tables;
  CudaFrame f = frame;
  int max_slots = plan.max_slots;
  bool eight_parts = plan.eight_parts;
  void* arguments[] = {&t, &f, &max_slots, &eight_parts};
  check_cuda(cudaMemsetAsync(f.arrived, 0, 2 * sizeof(unsigned), stream), "clear memory");
  check_cuda(cudaLaunchCooperativeKernel(kernel(plan), dim3(std::min(resident, t.bundle_count)),
                                         dim3(plan.threads), arguments, shared_bytes(plan), stream),
             "start the substeps");
}

}  // namespace tissue_sim
