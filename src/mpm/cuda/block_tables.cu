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

}  // namespace

void launch_move_tables(const CudaBlock* blocks, const CudaBlockOrigin* origins, int block_count,
                        const BlockTables& before, const BlockTables& made, BlockTables& to,
                        cudaStream_t stream) {
  move_tables<<<block_count, kThreads, 0, stream>>>(blocks, origins, Arrays(before), Arrays(made),
                                                    Arrays(to));
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
