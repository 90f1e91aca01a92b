// Which cells colliders may push in a frame.
#pragma once

#include <cuda_runtime_api.h>

#include "compute/host_device.h"
#include "mpm/cuda/state_on_host.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// A box that a collider sweeps in a frame; empty where min > max [m].
struct CudaBox {
  float min[3], max[3];
};

/// What the colliders of a frame sweep and how far tissue may go to meet them.
struct CudaReach {
  const CudaBox* swept;  ///< per collider
  int collider_count;
  std::uint32_t blades;  ///< bit c for a collider that pushes only points that have lost a bond
  float duration;        ///< [s]
  float margin;          ///< [m]
  const float4* went;    ///< displacements of the nodes that cells go to besides; null: unknown
};

/// What is found. One entry of `marks` for each node, of `pushed_parts` for each slot.
struct CudaNearCells {
  CudaNearCell* cells;  ///< in any order
  int* count;
  std::uint32_t* listed;  ///< per cell (lane / 8): its CudaNearCell::near, or 0
  std::size_t cell_count;
  std::uint8_t* marks;
  std::size_t node_count;
  std::uint32_t* pushed_parts;  ///< CudaTables::slot_parts with kPushed
  std::size_t slot_count;
};

/// Lists the cells that may meet a collider in a frame, from where they are, how fast the fastest
/// point of their block moves and what the colliders sweep, and marks their nodes. Points beyond
/// let go of what they touched.
void launch_near(const CudaTables& tables, const CudaNodes& state, const CudaMeasure* measures,
                 const CudaReach& reach, const CudaNearCells& near, cudaStream_t stream);

/// Marks the slots whose nodes contact may push: `pushed_parts`, one for each, follows `marks`.
void launch_mark_slots(const CudaTables& tables, const std::uint8_t* marks,
                       std::uint32_t* pushed_parts, std::size_t slot_count, cudaStream_t stream);

/// Whether a cell has come to a collider that it is not `listed` with, for it went faster later.
void launch_missed(const CudaTables& tables, const CudaNodes& state, const CudaMeasure* measures,
                   const CudaReach& reach, const std::uint32_t* listed, int* missed,
                   cudaStream_t stream);

// Where friction holds points on tools and the ground, as a list of the few that touch: for
// checkpoints.

/// Lists the entries of `with` that are not 0, in any order; `count`, one number, becomes how many
/// there are, of which the list has room for `most`.
void launch_list_held(const std::uint8_t* with, const float4* hold, int entries, HeldPoint* held,
                      int most, int* count, cudaStream_t stream);
/// Makes these `count` entries of `with`, all others 0 before, what they were.
void launch_hold_again(const HeldPoint* held, int count, std::uint8_t* with, float4* hold,
                       cudaStream_t stream);

}  // namespace tissue_sim
