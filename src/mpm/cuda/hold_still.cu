#include "compute/for_each_cuda.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/hold_still.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 96;

/// A group each thread block: hold_still() of mpm/anchors/anchor_faces.h.
__global__ void hold_groups(const CudaRowGroup* groups, const CudaRowNodes* rows,
                            const float* inverses, float4* field) {
  __shared__ float held[3 * kFaceGroupRows], impulse[3 * kFaceGroupRows];
  const CudaRowGroup g = groups[blockIdx.x];
  const CudaRowNodes* const of_group = rows + g.first;
  float* const numbers = reinterpret_cast<float*>(field);
  const int thread = static_cast<int>(threadIdx.x);
  for (int i = thread; i < 3 * g.count; i += kThreads) {
    const CudaRowNodes& r = of_group[i / 3];
    float sum = 0;
    for (int k = 0; k < kFaceRowNodes; ++k) {
      sum += r.weight[k] * numbers[4 * static_cast<std::size_t>(r.node[k]) + i % 3];
    }
    held[i] = sum;
  }
  __syncthreads();
  for (int i = thread; i < 3 * g.count; i += kThreads) {
    const float* const inverse = inverses + g.inverse + i / 3 * g.count;
    float sum = 0;
    for (int j = 0; j < g.count; ++j) sum += inverse[j] * held[3 * j + i % 3];
    impulse[i] = sum;
  }
  __syncthreads();
  if (thread >= 3) return;
  for (int i = 0; i < g.count; ++i) {  // rows may have nodes in common
    const CudaRowNodes& r = of_group[i];
    for (int k = 0; k < kFaceRowNodes; ++k) {
      if (r.share[k] == 0) continue;
      numbers[4 * static_cast<std::size_t>(r.node[k]) + thread] -=
          r.share[k] * impulse[3 * i + thread];
    }
  }
}

template <class Node>
struct Connect {
  Node* nodes;
  CudaTables t;
  __device__ void operator()(int i) const {
    Node& n = nodes[i];
    const std::uint32_t slot = n.parts.x;
    n.shared = kNoSlot;
    if (slot == kNoSlot) return;
    n.shared = t.slot_parts[slot];
    n.parts = t.first_parts[slot];
    n.more = more_parts(t, n.shared);
    if (n.local >= 0 && t.slot_node[slot] >= 0) n.local |= kOwnedHere;
  }
};

}  // namespace

void launch_connect(CudaHeldNode* held, int count, const CudaTables& tables, cudaStream_t stream) {
  Gpu(stream).for_each(count, Connect<CudaHeldNode>{held, tables});
}
void launch_connect(CudaFaceEntry* entries, int count, const CudaTables& tables,
                    cudaStream_t stream) {
  Gpu(stream).for_each(count, Connect<CudaFaceEntry>{entries, tables});
}

void launch_hold_still(const CudaRowGroup* groups, int count, const CudaRowNodes* rows,
                       const float* inverse, float4* field, cudaStream_t stream) {
  if (count == 0) return;
  hold_groups<<<count, kThreads, 0, stream>>>(groups, rows, inverse, field);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
