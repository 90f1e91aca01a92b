// The substeps of a frame on the GPU, as one kernel.
#pragma once

#include <cuda_runtime_api.h>

#include "mpm/cuda/tables.h"

namespace tissue_sim {

inline constexpr int kMaxCudaThreads = 256;  ///< of a thread block

/// Contact may have so many thread blocks without a bundle beside the others; from kEnoughHelpers
/// on, large blocks leave colliders to them.
inline constexpr int kMostHelpers = 32, kEnoughHelpers = 16;

/// Warps that a thread block must have left for some of them to push while the others work on
/// forces.
inline constexpr int kFewestPushers = 2;

/// How a tissue's blocks are worked on.
struct CudaPlan {
  int threads = 64;          ///< of a thread block: one or two for each column of a bundle
  int max_slots = 0;         ///< of a bundle
  int max_plane_slots = 0;   ///< the same of one plane
  int max_columns = 0;       ///< of a bundle
  bool pairs = true;         ///< there are two threads for each column
  bool small = true;         ///< to be cached, if all bundles run at once
  bool cached = false;       ///< each thread block has one bundle only, whose tables it keeps
  bool eight_parts = false;  ///< of a node's force it keeps the places of eight, else of four
  bool keeps_held = false;   ///< of nodes that anchors' faces hold it keeps what moves them, too
  int max_held = 0;          ///< of these, in a bundle
  bool two_planes = false;   ///< the exchange holds two planes, and threads wait half as often
  bool pushes = false;       ///< with contact, ...
  bool touches = false;      ///< ... of tissue with tissue too
  bool fronts = false;       ///< ... and fronts of cuts: contacts may be none then
  bool neo_hookean = false, fixed_corotated = false, viscous = false;  ///< what there is
  int resident = 0;  ///< thread blocks that run at once: resident_blocks()
};

/// How a thread block's shared memory is laid out.
struct CudaLayout {
  int max_slots;
  int node_room, exchange;  ///< float4s: for a bundle's nodes, for what columns give to planes
  int cells;                ///< where among the nodes' float4s cells near colliders come
  int workers;              ///< the threads that work on forces; the others push meanwhile
  int held;                 ///< nodes in HeldCache
  bool eight_parts, two_planes;
};

using CudaKernel = void (*)(CudaTables, CudaFrame, CudaLayout);
CudaKernel pushing_kernel(const CudaPlan& plan);
CudaKernel touching_kernel(const CudaPlan& plan);
CudaKernel front_kernel(const CudaPlan& plan);

/// Thread blocks that run at once; 0 where the plan does not fit the GPU. Sets CudaPlan::cached,
/// eight_parts, keeps_held and two_planes.
int resident_blocks(CudaPlan& plan, int block_count);

/// Thread blocks that run at once, cached if the plan is small, and the most slots with which as
/// many do.
int most_at_once(const CudaPlan& plan);
int most_slots(const CudaPlan& plan);

/// Enqueues substeps as one kernel, with contact if the plan has it. The state is then in
/// `state[(current + substeps) % 2]`.
void launch_substeps(const CudaPlan& plan, const CudaTables& tables, const CudaFrame& frame,
                     cudaStream_t stream);

}  // namespace tissue_sim
