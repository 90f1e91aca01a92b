#include <cub/device/device_radix_sort.cuh>
#include <stdexcept>

#include "compute/for_each_cuda.h"
#include "mpm/cuda/connect_slots.h"

namespace tissue_sim {
namespace {

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
