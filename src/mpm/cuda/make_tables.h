// The tables of CudaTables, made on the host from the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/block_tables.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// See CudaTables; what slots share is found on the GPU (connect_slots.h).
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

/// The nodes as the GPU has them: u and mass, v and inverse mass.
void pack_nodes(const Nodes& nodes, Cpu& cpu, float4* u, float4* v);
/// The components of `count` vectors.
void unpack_field(const float4* from, std::size_t count, Cpu& cpu, Array<float>* to);

}  // namespace tissue_sim
