// The front of a cut on a GPU: mpm/split/front.h, docs/mpm.md.
//
// Parted nodes have their places in the arrays of nodes, behind these: how far their two sides are
// apart with the mass of that, and how fast with one over it. So what saves, restores or displaces
// nodes does it to them, too.
#pragma once

#include <cuda_runtime_api.h>

#include "compute/device_array.h"
#include "mpm/blocks/front_cell.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// What acts on a node, or on a parted one: `count` forces at CudaFront::places from `first` on.
struct CudaFrontSum {
  std::int32_t node;  ///< in the arrays of nodes
  std::int32_t first, count;
};

struct CudaFront {
  int cell_count, part_count, sum_count, node_count;
  int first_parted;  ///< sum from which on they are those of parted nodes
  int first_node;    ///< where these are in the arrays of nodes
  const FrontCell* cells;
  const FrontPart* parts;
  const CudaFrontSum* sums;
  const std::int32_t* places;  ///< in `force` or, for parted nodes, in `pull`
  float4* force;               ///< of the cells on their nodes, [28] each [N]
  float4* pull;                ///< on their parts [N]
  double* energy;              ///< of the cells, then of the motion of parted nodes [J]
};

struct FrontOnDevice {
  DeviceArray<FrontCell> cells;
  DeviceArray<FrontPart> parts;
  DeviceArray<CudaFrontSum> sums;
  DeviceArray<std::int32_t> places;
  DeviceArray<float4> force, pull;
  DeviceArray<double> energy;
  PinnedArray<double> host_energy;
  int first_parted = 0, first_node = 0, node_count = 0;

  CudaFront view() const {
    return {static_cast<int>(cells.size()),
            static_cast<int>(parts.size()),
            static_cast<int>(sums.size()),
            node_count,
            first_parted,
            first_node,
            cells.data(),
            parts.data(),
            sums.data(),
            places.data(),
            force.data(),
            pull.data(),
            energy.data()};
  }
  std::size_t bytes() const {
    return cells.bytes() + parts.bytes() + sums.bytes() + places.bytes() + force.bytes() +
           pull.bytes() + energy.bytes();
  }
};

/// Works out what the cells push.
void launch_front_forces(const CudaFront& front, const CudaNodes& state, cudaStream_t stream);
/// After all nodes were moved from one state to the other without that: moves them on, and the
/// parted ones.
void launch_move_front(const CudaFront& front, const NodeStep& step, const CudaNodes& from,
                       const CudaNodes& to, cudaStream_t stream);
/// Energies, to CudaFront::energy.
void launch_front_energy(const CudaFront& front, const CudaNodes& state, cudaStream_t stream);

}  // namespace tissue_sim
