// The tables of CudaTables, made on the host from the blocks.
#pragma once

#include <vector>

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// See CudaTables; what slots share is found on the GPU (connect_slots.h). Kept from cut to cut,
/// for its memory.
struct HostTables {
  std::vector<CudaBody> bodies;     ///< of each body, its materials
  std::vector<int> first_material;  ///< of each body, in `bodies`
  std::vector<CudaBlock> blocks;
  std::vector<int> of_host;     ///< per block: which of Blocks::all it is
  std::vector<int> first_slot;  ///< of each of Blocks::all
  std::vector<CudaBundle> bundles;
  std::vector<CudaColumn> columns;
  PinnedArray<std::int32_t> slot_node;
  PinnedArray<float> volume, partial;
  PinnedArray<std::int32_t> point;
  int max_slots = 0;        ///< of a bundle
  int max_plane_slots = 0;  ///< the same of one plane
  int max_columns = 0;      ///< of a bundle
};

/// `bundles` are the blocks, by their places in Blocks::all, that share a thread block.
void make_tables(const MpmState& state, const std::vector<std::vector<int>>& bundles,
                 HostTables& tables);

/// The nodes as the GPU has them: u and mass, v and inverse mass.
void pack_nodes(const Nodes& nodes, Cpu& cpu, float4* u, float4* v);
/// The components of `count` vectors.
void unpack_field(const float4* from, std::size_t count, Cpu& cpu, Array<float>* to);

}  // namespace tissue_sim
