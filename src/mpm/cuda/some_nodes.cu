#include "compute/for_each_cuda.h"
#include "mpm/cuda/some_nodes.h"

namespace tissue_sim {
namespace {

struct Gather {
  CudaNodes from;
  const std::int32_t* list;
  int count;
  float4* packed;
  __device__ void operator()(int i) const {
    packed[i] = from.u[list[i]];
    packed[count + i] = from.v[list[i]];
  }
};

struct Scatter {
  const float4* packed;
  const std::int32_t* list;
  int count;
  CudaNodes to, and_to;
  __device__ void operator()(int i) const {
    to.u[list[i]] = and_to.u[list[i]] = packed[i];
    to.v[list[i]] = and_to.v[list[i]] = packed[count + i];
  }
};

}  // namespace

void launch_gather(const CudaNodes& from, const std::int32_t* list, int count, float4* packed,
                   cudaStream_t stream) {
  Gpu(stream).for_each(count, Gather{from, list, count, packed});
}

void launch_scatter(const float4* packed, const std::int32_t* list, int count, const CudaNodes& to,
                    const CudaNodes& and_to, cudaStream_t stream) {
  Gpu(stream).for_each(count, Scatter{packed, list, count, to, and_to});
}

}  // namespace tissue_sim
