#include "compute/for_each_cuda.h"
#include "mpm/cuda/block_tables.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 256;

/// Pointers to BlockTables.
struct Arrays {
  std::int32_t *slot_node, *point;
  float *volume, *partial;

  explicit Arrays(const BlockTables& t)
      : slot_node(t.slot_node.data()),
        point(t.point.data()),
        volume(t.volume.data()),
        partial(t.partial.data()) {}
};

/// One thread block for each block.
__global__ void __launch_bounds__(kThreads)
    move_tables(const CudaBlock* blocks, const CudaBlockOrigin* origins, const Arrays before,
                const Arrays made, const Arrays to) {
  const CudaBlock& b = blocks[blockIdx.x];
  const CudaBlockOrigin origin = origins[blockIdx.x];
  const Arrays& from = origin.is_new != 0 ? made : before;
  const int thread = static_cast<int>(threadIdx.x), cells = b.nx * b.ny * b.nz;
  for (int i = thread; i < b.slots(); i += kThreads) {
    const std::int32_t entry = from.slot_node[origin.first_slot + i];
    to.slot_node[b.first_slot + i] = entry < 0 ? ~entry : entry;
  }
  for (int i = thread; i < 8 * cells; i += kThreads) {
    to.point[b.first_lane + i] = from.point[origin.first_lane + i];
    to.volume[b.first_lane + i] = from.volume[origin.first_lane + i];
  }
  for (int i = thread; i < cells; i += kThreads) {
    to.partial[b.first_lane / 8 + i] = from.partial[origin.first_lane / 8 + i];
  }
}

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

void launch_move_tables(const CudaBlock* blocks, const CudaBlockOrigin* origins, int block_count,
                        const BlockTables& before, const BlockTables& made, BlockTables& to,
                        cudaStream_t stream) {
  move_tables<<<block_count, kThreads, 0, stream>>>(blocks, origins, Arrays(before), Arrays(made),
                                                    Arrays(to));
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_gather(const CudaNodes& from, const std::int32_t* list, int count, float4* packed,
                   cudaStream_t stream) {
  Gpu(stream).for_each(count, Gather{from, list, count, packed});
}

void launch_scatter(const float4* packed, const std::int32_t* list, int count, const CudaNodes& to,
                    const CudaNodes& and_to, cudaStream_t stream) {
  Gpu(stream).for_each(count, Scatter{packed, list, count, to, and_to});
}

}  // namespace tissue_sim
