// The front of a cut on the GPU: what its cells push, beside the blocks. mpm/split/front.h.
#pragma once

#include "compute/device_array.h"
#include "mpm/blocks/front_cell.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// See Front.
struct FrontOnDevice {
  DeviceArray<FrontCell> cells;
  DeviceArray<FrontPart> parts;
  DeviceArray<FrontSum> node_sums, part_sums;
  DeviceArray<std::int32_t> node_places, part_places;
  DeviceArray<float4> d, rate;      ///< of parted nodes; d.w: their mass
  DeviceArray<float4> force, pull;  ///< of the cells [28] each, of the parts
  DeviceArray<double> energy;       ///< per cell [J]
  PinnedArray<float4> host_d, host_rate;
  PinnedArray<double> host_energy;
  DeviceArray<float4> d_before, rate_before;  ///< of the checkpoint

  bool empty() const { return cells.size() == 0; }
  std::size_t bytes() const {
    return cells.bytes() + parts.bytes() + node_sums.bytes() + part_sums.bytes() +
           node_places.bytes() + part_places.bytes() + d.bytes() + rate.bytes() + force.bytes() +
           pull.bytes() + energy.bytes() + d_before.bytes() + rate_before.bytes();
  }
};

/// Enqueues what the cells push in this state: a warp for each of them.
void launch_front_cells(const FrontOnDevice& front, const CudaNodes& state, cudaStream_t stream);
/// Moves nodes on by it that were moved on without it, and parted ones.
void launch_move_front(const FrontOnDevice& front, const CudaNodes& moved, const NodeStep& step,
                       cudaStream_t stream);
/// Energy of each cell beside what its block has: FrontOnDevice::energy.
void launch_front_energy(const FrontOnDevice& front, const CudaNodes& state, cudaStream_t stream);

}  // namespace tissue_sim
