// Which slots share a node, found on the GPU.
#pragma once

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Room that connect_slots() works in, kept from cut to cut.
struct ConnectRoom {
  DeviceArray<std::int32_t> slot, node;
  DeviceArray<char> sorting;
  DeviceArray<int> most;
  std::size_t bytes() const { return slot.bytes() + node.bytes() + sorting.bytes() + most.bytes(); }
};

/// What CudaTables knows of the slots.
struct SlotTables {
  std::int32_t* slot_node;
  std::uint32_t* slot_parts;
  uint4* first_parts;
  std::uint32_t* parts;
  std::size_t count;  ///< of slots, and so many are in `parts`
};

/// From `slot_node`, the node of each slot, below `node_count`: fills the others, and marks in it
/// the slots whose node the first slot that shares it writes. Enqueues, into `most_sharing` on the
/// host, how many slots share a node at most: more than kMostSharing and the tables are wrong.
/// Throws std::runtime_error where there are more slots than tables can hold.
void connect_slots(const SlotTables& slots, std::size_t node_count, ConnectRoom& room,
                   int* most_sharing, cudaStream_t stream);
inline constexpr int kMostSharing = 63;

}  // namespace tissue_sim
