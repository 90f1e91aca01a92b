#include "compute/cuda_check.h"
#include "mpm/cuda/face_nodes.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 128;

__global__ void gather_nodes(const std::int32_t* nodes, int count, const CudaNodes state,
                             float4* out) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= count) return;
  out[i] = state.u[nodes[i]];
  out[count + i] = state.v[nodes[i]];
}

__global__ void mark_nodes(const CudaContactNodes* contacts, int count, std::uint8_t* marks) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= 27 * count) return;
  const CudaContactNodes& c = contacts[i / 27];
  marks[c.own[i % 27]] = marks[c.other[i % 27]] = 1;
}

}  // namespace

void launch_gather(const std::int32_t* nodes, int count, const CudaNodes& state, float4* out,
                   cudaStream_t stream) {
  if (count == 0) return;
  gather_nodes<<<(count + kThreads - 1) / kThreads, kThreads, 0, stream>>>(nodes, count, state,
                                                                           out);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_mark(const CudaContactNodes* contacts, int count, std::uint8_t* marks,
                 std::size_t node_count, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(marks, 0, node_count, stream), "clear memory");
  if (count == 0) return;
  mark_nodes<<<(27 * count + kThreads - 1) / kThreads, kThreads, 0, stream>>>(contacts, count,
                                                                              marks);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
