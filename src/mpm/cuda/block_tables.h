// The tables of blocks that fill the GPU's memory, and how they follow when some blocks are made
// anew: those of all others stay there, in new places.
#pragma once

#include <cuda_runtime_api.h>
#include <vector_types.h>

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
};

/// Fills `to`, which has its size, with what the blocks have in `before` or, those that are new, in
/// `made`. Which block writes a node, connect_slots() must say again.
void launch_move_tables(const CudaBlock* blocks, const CudaBlockOrigin* origins, int block_count,
                        const BlockTables& before, const BlockTables& made, BlockTables& to,
                        cudaStream_t stream);

// Which slots share a node, found on the GPU.

/// Room that connect_slots() works in, kept from cut to cut.
struct ConnectRoom {
  DeviceArray<std::int32_t> slot, node;
  DeviceArray<char> sorting;
  DeviceArray<int> most;
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

// Takes out of a field of all nodes what anchors' faces hold: for the substep that tissue bears.

/// FaceRow without its place.
struct CudaRowNodes {
  std::int32_t node[kFaceRowNodes];
  float weight[kFaceRowNodes], share[kFaceRowNodes];
};
/// FaceGroup.
struct CudaRowGroup {
  int first, count, inverse;
};

/// Fills what CudaHeldFaces::held and ::entries have of the tables.
void launch_connect(CudaHeldNode* held, int count, const CudaTables& tables, cudaStream_t stream);
void launch_connect(CudaFaceEntry* entries, int count, const CudaTables& tables,
                    cudaStream_t stream);

/// As hold_still() of mpm/anchors/anchor_faces.h does for each of `count` groups.
void launch_hold_still(const CudaRowGroup* groups, int count, const CudaRowNodes* rows,
                       const float* inverse, float4* field, cudaStream_t stream);

}  // namespace tissue_sim
