// The front of a cut on a GPU: mpm/split/front.h, docs/mpm.md. What its cells push within substeps:
// push_front.h.
#pragma once

#include <cuda_runtime_api.h>

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

struct FrontOnDevice {
  DeviceArray<FrontCell> cells;
  DeviceArray<FrontPart> parts;
  DeviceArray<int4> tasks;     ///< CudaFront::tasks
  DeviceArray<double> energy;  ///< of the cells, then of the motion of parted nodes [J]
  PinnedArray<double> host_energy;
  DeviceArray<float4> motion_fields;  ///< CudaMotionRoom::fields, where `pushed` is no room
  int first_node = 0, node_count = 0;
  bool marked = false;  ///< whether CudaTables::slot_parts say which nodes it pushes

  CudaFront view() const {
    return {static_cast<int>(cells.size()), node_count,  first_node, cells.data(), parts.data(),
            static_cast<int>(tasks.size()), tasks.data()};
  }
  std::size_t bytes() const {
    return cells.bytes() + parts.bytes() + tasks.bytes() + energy.bytes() + motion_fields.bytes();
  }
};

/// Energies of the cells, then of the motion of parted nodes [J].
void launch_front_energy(const CudaFront& front, const CudaNodes& state, double* energy,
                         cudaStream_t stream);
/// Marks the nodes that its cells push: kMarkedByFront in `marks`, one for each node.
void launch_mark_front(const CudaFront& front, std::uint8_t* marks, std::size_t node_count,
                       cudaStream_t stream);

}  // namespace tissue_sim
