// Nodes that contacts of tissue with tissue work with: what the host wants to know of them, and
// which of them contacts may push.
#pragma once

#include <cuda_runtime_api.h>

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Copies u, then v, of these nodes to `out` (room for 2 * count).
void launch_gather(const std::int32_t* nodes, int count, const CudaNodes& state, float4* out,
                   cudaStream_t stream);

/// Sets `marks`, of `node_count` nodes, for the nodes of these contacts and clears it for others.
void launch_mark(const CudaContactNodes* contacts, int count, std::uint8_t* marks,
                 std::size_t node_count, cudaStream_t stream);

}  // namespace tissue_sim
