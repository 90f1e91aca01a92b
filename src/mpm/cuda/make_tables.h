// The tables of CudaTables, made on the host from the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/block_tables.h"
#include "mpm/cuda/face_rows.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// See CudaTables; what slots share is found on the GPU (block_tables.h).
struct HostTables {
  std::vector<CudaBody> bodies;     ///< of each body, its materials
  std::vector<int> first_material;  ///< of each body, in `bodies`
  std::vector<CudaBlock> blocks;
  std::vector<int> of_host;     ///< per block: which of Blocks::all it is
  std::vector<int> first_slot;  ///< of each of Blocks::all
  std::vector<CudaBundle> bundles;
  std::vector<CudaColumn> columns;
  std::size_t slots = 0, lanes = 0;     ///< of all blocks
  std::vector<int> number;              ///< Block::number of each
  std::vector<CudaBlockOrigin> origin;  ///< of each
  bool all_new = true;                  ///< all blocks are
  BlockTablesIn<PinnedArray> made;      ///< of the new blocks alone, one after the other
  int max_slots = 0;                    ///< of a bundle
  int max_plane_slots = 0;              ///< the same of one plane
  int max_columns = 0;                  ///< of a bundle
};

/// Makes them anew; what blocks that were in `tables` before have there stays on the GPU. `bundles`
/// are the blocks, by their places in Blocks::all, that share a thread block.
void make_tables(const MpmState& state, const std::vector<std::vector<int>>& bundles,
                 HostTables& tables);

// The tables of CudaHeldFaces, from AnchorFaces and the blocks: make_face_rows.cpp.

/// Nodes that rows have or an anchor carries, numbered as they follow one another.
struct HeldNodes {
  std::vector<std::int32_t> number;   ///< per node, -1 for others
  std::vector<std::int32_t> group;    ///< of each, whose rows move it; -1
  std::vector<std::int32_t> carried;  ///< of each, its place in AnchorFaces::held; -1
};

struct HostFaceRows {
  bool is_new = false;  ///< made with the tables of blocks, to go up after them
  HeldNodes nodes;      ///< whose memory is kept from one time to the next
  std::vector<CudaFaceChunk> chunks;
  std::vector<int> first_carried;
  std::vector<CudaHeldNode> held;  ///< in their `parts.x` a slot or kNoSlot, for launch_connect()
  std::vector<int> first_held;
  int most_held = 0;                   ///< of a bundle
  std::vector<CudaFaceEntry> entries;  ///< the same
  std::vector<CudaFaceShare> shares;
  std::vector<CudaFaceRow> rows;
  std::vector<CudaCarriedNode> carried;
  bool carries_always = false;  ///< see CudaHeldFaces
  std::size_t room_each = 0;    ///< of a bundle, for chunks that are large [floats]
};

/// Makes `to` for the bundles of `tables`. A chunk comes to where columns give to a plane of so
/// many slots.
void make_face_rows(const MpmState& state, const HostTables& tables, int plane_slots,
                    HostFaceRows& to);

}  // namespace tissue_sim
