#include <cub/device/device_radix_sort.cuh>
#include <stdexcept>

#include "compute/for_each_cuda.h"
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

struct PlaceVertex {
  CudaNodes nodes;
  const BoundaryMesh::Vertex* vertices;
  float* places;
  __device__ void operator()(int i) const {
    const BoundaryMesh::Vertex& v = vertices[i];
    const AxisWeights weights(v.place);
    double x[3];
    for (int a = 0; a < 3; ++a) x[a] = reinterpret_cast<const double*>(&v.rest)[a];
    for (int k = 0; k < 27; ++k) {
      const float4 u = nodes.u[v.node[k]];
      const float w = weights.at(k);
      x[0] += w * u.x, x[1] += w * u.y, x[2] += w * u.z;
    }
    for (int a = 0; a < 3; ++a) places[3 * i + a] = static_cast<float>(x[a]);
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

void launch_gather(const CudaNodes& from, const std::int32_t* list, int count, float4* packed,
                   cudaStream_t stream) {
  Gpu(stream).for_each(count, Gather{from, list, count, packed});
}

void launch_scatter(const float4* packed, const std::int32_t* list, int count, const CudaNodes& to,
                    const CudaNodes& and_to, cudaStream_t stream) {
  Gpu(stream).for_each(count, Scatter{packed, list, count, to, and_to});
}

void launch_boundary_places(const CudaNodes& nodes, const BoundaryMesh::Vertex* vertices, int count,
                            float* places, cudaStream_t stream) {
  Gpu(stream).for_each(count, PlaceVertex{nodes, vertices, places});
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

}  // namespace tissue_sim
