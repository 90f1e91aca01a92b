// What the GPU's kernels see of the front of a cut (mpm/split/front.h): plain structs with device
// pointers.
#pragma once

#include "mpm/blocks/front_cell.h"

namespace tissue_sim {

/// Parted nodes have their places in the arrays of nodes, behind these: how far their two sides are
/// apart with the mass of that, and how fast with one over it. So what saves, restores, displaces
/// or pushes nodes does it to them, too.
struct CudaFront {
  int cell_count = 0, node_count = 0;
  int first_node = 0;  ///< where parted nodes are in the arrays of nodes
  const FrontCell* cells = nullptr;
  const FrontPart* parts = nullptr;
  int task_count = 0;
  const int4* tasks = nullptr;  ///< a cell and a pass of it (front_warp.h), or kStabilises for what
                                ///< stabilises it; its first part, and how many there are
};
inline constexpr int kStabilises = -1;

}  // namespace tissue_sim
