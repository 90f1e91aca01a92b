// The tables of CudaTables, made on the host from the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/tables.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// See CudaTables.
struct HostTables {
  std::vector<CudaBody> bodies;     ///< of each body, its materials
  std::vector<int> first_material;  ///< of each body, in `bodies`
  std::vector<CudaBlock> blocks;
  std::vector<int> of_host;  ///< per block: which of Blocks::all it is
  std::vector<CudaBundle> bundles;
  std::vector<CudaColumn> columns;
  std::vector<std::int32_t> slot_node;
  std::vector<std::uint32_t> slot_parts, parts;
  std::vector<float> volume, partial;
  std::vector<std::int32_t> point;
  int max_slots = 0;   ///< of a bundle
  int max_halves = 0;  ///< half cells of a bundle's columns, each as tall as the tallest
};

/// `bundles` are the blocks, by their places in Blocks::all, that share a thread block.
HostTables make_tables(const MpmState& state, const std::vector<std::vector<int>>& bundles);

/// The nodes as the GPU has them: u and mass, v and inverse mass.
void pack_nodes(const Nodes& nodes, float4* u, float4* v);
void unpack_nodes(const float4* u, const float4* v, Nodes& nodes);

}  // namespace tissue_sim
