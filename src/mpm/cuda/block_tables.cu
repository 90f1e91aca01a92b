#include <cub/device/device_radix_sort.cuh>
#include <stdexcept>

#include "compute/for_each_cuda.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/block_tables.h"
#include "mpm/surface/facet_in_world.h"

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

struct Number {
  std::int32_t* slot;
  __device__ void operator()(int i) const { slot[i] = i; }
};

/// Of the slots sorted by node, and those of a node by number, in SlotTables::parts.
struct Connect {
  const std::int32_t* node;
  SlotTables t;
  int* most;

  __device__ void operator()(int i) const {
    const std::int32_t n = node[i], slots = static_cast<std::int32_t>(t.count);
    std::int32_t begin = i, end = i + 1;
    while (begin > 0 && node[begin - 1] == n && i - begin < kMostSharing) --begin;
    while (end < slots && node[end] == n && end - begin <= kMostSharing) ++end;
    const std::uint32_t count = end - begin, slot = t.parts[i];
    if (count > 1) atomicMax(most, static_cast<int>(count));
    const auto part = [&](std::uint32_t k) { return k < count ? t.parts[begin + k] : 0u; };
    t.slot_parts[slot] = count > 1 ? static_cast<std::uint32_t>(begin) << 6 | count : 0;
    t.first_parts[slot] = {part(0), part(1), part(2), part(3)};
    if (begin != i) t.slot_node[slot] = ~n;
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

void connect_slots(const SlotTables& t, std::size_t node_count, ConnectRoom& room,
                   int* most_sharing, cudaStream_t stream) {
  if (t.count >= 1u << 25) {
    throw std::runtime_error(
        "the tissue has more nodes than the GPU's tables hold: raise cell_size");
  }
  const int count = static_cast<int>(t.count);
  room.slot.resize(t.count);
  room.node.resize(t.count);
  room.most.resize(1);
  room.most.clear(stream);
  Gpu gpu(stream);
  gpu.for_each(count, Number{room.slot.data()});
  int bits = 1;
  while (node_count >> bits != 0) ++bits;
  auto* sorted = reinterpret_cast<std::int32_t*>(t.parts);
  const auto sort = [&](void* with, std::size_t& bytes) {
    check_cuda(cub::DeviceRadixSort::SortPairs(with, bytes, t.slot_node, room.node.data(),
                                               room.slot.data(), sorted, count, 0, bits, stream),
               "sort");
  };
  std::size_t bytes = 0;
  sort(nullptr, bytes);
  room.sorting.resize(bytes);
  sort(room.sorting.data(), bytes);
  gpu.for_each(count, Connect{room.node.data(), t, room.most.data()});
  room.most.download(most_sharing, 1, stream);
}

namespace {

constexpr int kHoldThreads = 96;

/// A group each thread block: hold_still() of mpm/anchors/anchor_faces.h.
__global__ void hold_groups(const CudaRowGroup* groups, const CudaRowNodes* rows,
                            const float* inverses, float4* field) {
  __shared__ float held[3 * kFaceGroupRows], impulse[3 * kFaceGroupRows];
  const CudaRowGroup g = groups[blockIdx.x];
  const CudaRowNodes* const of_group = rows + g.first;
  float* const numbers = reinterpret_cast<float*>(field);
  const int thread = static_cast<int>(threadIdx.x);
  for (int i = thread; i < 3 * g.count; i += kHoldThreads) {
    const CudaRowNodes& r = of_group[i / 3];
    float sum = 0;
    for (int k = 0; k < kFaceRowNodes; ++k) {
      sum += r.weight[k] * numbers[4 * static_cast<std::size_t>(r.node[k]) + i % 3];
    }
    held[i] = sum;
  }
  __syncthreads();
  for (int i = thread; i < 3 * g.count; i += kHoldThreads) {
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
struct ConnectHeld {
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
  Gpu(stream).for_each(count, ConnectHeld<CudaHeldNode>{held, tables});
}
void launch_connect(CudaFaceEntry* entries, int count, const CudaTables& tables,
                    cudaStream_t stream) {
  Gpu(stream).for_each(count, ConnectHeld<CudaFaceEntry>{entries, tables});
}

void launch_hold_still(const CudaRowGroup* groups, int count, const CudaRowNodes* rows,
                       const float* inverse, float4* field, cudaStream_t stream) {
  if (count == 0) return;
  hold_groups<<<count, kHoldThreads, 0, stream>>>(groups, rows, inverse, field);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
