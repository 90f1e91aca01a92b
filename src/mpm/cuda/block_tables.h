// The tables of blocks that fill the GPU's memory, and how they follow when some blocks are made
// anew: those of all others stay there, in new places.
#pragma once

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Where a block's slots and lanes are found: among those that were just made for new blocks, or in
/// the tables before.
struct CudaBlockOrigin {
  int first_slot, first_lane;
  int is_new;
};

/// See CudaTables.
template <template <class> class ArrayOf>
struct BlockTablesIn {
  ArrayOf<std::int32_t> slot_node, point;
  ArrayOf<float> volume, partial;

  void resize(std::size_t slots, std::size_t lanes) {
    slot_node.resize(slots);
    point.resize(lanes);
    volume.resize(lanes);
    partial.resize(lanes / 8);
  }
};

struct BlockTables : BlockTablesIn<DeviceArray> {
  void upload(const BlockTablesIn<PinnedArray>& from, cudaStream_t stream) {
    slot_node.upload(from.slot_node, stream);
    point.upload(from.point, stream);
    volume.upload(from.volume, stream);
    partial.upload(from.partial, stream);
  }
  void swap(BlockTables& other) {
    slot_node.swap(other.slot_node);
    point.swap(other.point);
    volume.swap(other.volume);
    partial.swap(other.partial);
  }
  std::size_t bytes() const {
    return slot_node.bytes() + point.bytes() + volume.bytes() + partial.bytes();
  }
};

/// Fills `to`, which has its size, with what the blocks have in `before` or, those that are new, in
/// `made`. Which block writes a node, connect_slots() must say again.
void launch_move_tables(const CudaBlock* blocks, const CudaBlockOrigin* origins, int block_count,
                        const BlockTables& before, const BlockTables& made, BlockTables& to,
                        cudaStream_t stream);

/// Packs what the nodes of `list` have: first u and mass of all, then v and inverse mass.
void launch_gather(const CudaNodes& from, const std::int32_t* list, int count, float4* packed,
                   cudaStream_t stream);
/// Puts it back, into two states: what no block moves must be the same in both.
void launch_scatter(const float4* packed, const std::int32_t* list, int count, const CudaNodes& to,
                    const CudaNodes& and_to, cudaStream_t stream);

}  // namespace tissue_sim
