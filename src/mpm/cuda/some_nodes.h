// Some of the nodes on their way to the host and back: those around a cut.
#pragma once

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Packs what the nodes of `list` have: first u and mass of all, then v and inverse mass.
void launch_gather(const CudaNodes& from, const std::int32_t* list, int count, float4* packed,
                   cudaStream_t stream);
/// Puts it back, into two states: what no block moves must be the same in both.
void launch_scatter(const float4* packed, const std::int32_t* list, int count, const CudaNodes& to,
                    const CudaNodes& and_to, cudaStream_t stream);

}  // namespace tissue_sim
