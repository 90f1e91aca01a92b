#include <cuda_runtime.h>

#include <algorithm>

#include "compute/cuda_check.h"
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {
namespace {

const void* kernel(const CudaPlan& plan) {
  return reinterpret_cast<const void*>(plan.fronts    ? front_kernel(plan)
                                       : plan.touches ? touching_kernel(plan)
                                       : plan.pushes  ? pushing_kernel(plan)
                                                      : kernel_of<Can::kCuts>(plan));
}

CudaLayout layout_of(const CudaPlan& plan) {
  CudaLayout layout;
  const bool velocities = plan.viscous || (plan.neo_hookean && plan.fixed_corotated);
  layout.max_slots = plan.max_slots;
  layout.node_room = (velocities ? 2 : 1) * plan.max_slots;
  layout.cells = 0;
  layout.workers = plan.threads;
  if (plan.pushes) {
    const int cells = plan.threads / 32 * static_cast<int>(sizeof(WarpNodes)) / 16 + 1;
    if (plan.small && plan.pairs) {
      layout.cells = layout.node_room;
      layout.node_room += cells;
      const int busy = std::max(2 * plan.max_columns, plan.max_plane_slots),
                warps = (busy + 31) / 32;
      if (plan.cached && 32 * (warps + kFewestPushers) <= plan.threads) layout.workers = 32 * warps;
    } else {  // they come where the nodes of the block were
      layout.node_room = std::max(layout.node_room, cells);
    }
  }
  layout.exchange = (plan.two_planes ? 18 : 9) * plan.max_plane_slots;
  layout.held = plan.cached && plan.keeps_held ? plan.max_held : 0;
  layout.eight_parts = plan.eight_parts;
  layout.two_planes = plan.two_planes;
  return layout;
}

std::size_t shared_bytes(const CudaPlan& plan) {
  const CudaLayout layout = layout_of(plan);
  const std::size_t of_slot =
      (plan.cached ? sizeof(uint4) + 8 : 0) + (plan.eight_parts ? sizeof(uint4) : 0);
  return sizeof(SharedWork) + sizeof(CudaHeldNode) * layout.held + of_slot * layout.max_slots +
         sizeof(float4) * (layout.node_room + layout.exchange) + kMaxColliders * sizeof(Collider) +
         sizeof(FaceRounds);
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
  for (const bool two : {true, false}) {
    for (const bool held : {true, false}) {
      for (const bool eight : {true, false}) {
        if (!plan.cached || (held && plan.max_held == 0)) continue;
        plan.two_planes = two;
        plan.keeps_held = held;
        plan.eight_parts = eight;
        const int resident = resident_of(plan);
        if (resident >= block_count) return resident;
      }
    }
  }
  plan.cached = plan.eight_parts = plan.keeps_held = plan.two_planes = false;
  const int resident = resident_of(plan);
  plan.two_planes = true;
  if (resident_of(plan) < resident) plan.two_planes = false;
  return resident;
}

int most_at_once(const CudaPlan& plan) {
  CudaPlan most = plan;
  most.cached = plan.small;
  most.eight_parts = most.keeps_held = most.two_planes = false;
  return resident_of(most);
}

int most_slots(const CudaPlan& plan) {
  const int resident = most_at_once(plan);
  if (resident == 0) return plan.max_slots;
  const auto as_many = [&](int more) {
    CudaPlan larger = plan;
    larger.max_slots += more;
    return most_at_once(larger) == resident;
  };
  constexpr int kStep = 64;
  int least = 0, beyond = kStep;  // more slots with which as many run, and with which fewer do
  while (as_many(beyond)) {
    least = beyond;
    beyond *= 2;
  }
  while (beyond - least > kStep) {
    const int middle = least + (beyond - least) / (2 * kStep) * kStep;
    (as_many(middle) ? least : beyond) = middle;
  }
  return plan.max_slots + least;
}

void launch_substeps(const CudaPlan& plan, const CudaTables& tables, const CudaFrame& frame,
                     cudaStream_t stream) {
  CudaTables t = tables;
  CudaFrame f = frame;
  CudaLayout layout = layout_of(plan);
  void* arguments[] = {&t, &f, &layout};
  check_cuda(cudaMemsetAsync(f.arrived, 0, kArrivedWords * sizeof(unsigned), stream),
             "clear memory");
  const int blocks = std::min(plan.resident, t.bundle_count + (plan.pushes ? kMostHelpers : 0));
  check_cuda(cudaLaunchCooperativeKernel(kernel(plan), dim3(blocks), dim3(plan.threads), arguments,
                                         shared_bytes(plan), stream),
             "start the substeps");
}

}  // namespace tissue_sim
