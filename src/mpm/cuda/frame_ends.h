// What happens on the GPU between the substeps of two frames: how blocks stand, and the
// clouds.
#pragma once

#include <cuda_runtime_api.h>

#include "mpm/blocks/update_node.h"
#include "mpm/cuda/tables.h"
#include "tissue_sim/point.h"

namespace tissue_sim {

/// Energies, bounds and stiffness of each block in this state. `max_slots` of a block.
void launch_measure(const CudaTables& tables, const CudaNodes& state, int max_slots,
                    CudaMeasure* measures, cudaStream_t stream);

/// Lists the points whose largest strain reaches `share` of that at the tear_stretch of their body,
/// in any order, into `found`, which has room for so many; `count`, one number, becomes how many
/// they are.
void launch_stretched(const CudaTables& tables, const CudaNodes& state, int max_slots, float share,
                      StretchedPoint* found, int room, int* count, cudaStream_t stream);

/// Writes where all points are, [points][3] [m].
void launch_places(const CudaTables& tables, float4* u, int max_slots, float* places,
                   cudaStream_t stream);

/// What clouds need to know of points beside where they are.
struct CudaCloud {
  Point* points;                ///< where they go
  int stride;                   ///< every stride-th point, in order
  const std::int32_t* place;    ///< or, if not null: the place of each point in the cloud, or -1
  const std::int32_t* piece;    ///< per point: its piece's id
  const std::uint32_t* colour;  ///< per piece id
  const std::uint8_t* whole;    ///< per point: how many bonds it has when the tissue is whole
};
void launch_cloud(const CudaTables& tables, const CudaNodes& state, int max_slots,
                  const CudaCloud& cloud, cudaStream_t stream);

/// Where an anchor holds the point at `index` of a cloud, which has no stress there; -1: not in it.
struct AnchoredPoint {
  int index;
  float x[3];
};
void launch_anchored(const AnchoredPoint* held, int count, Point* cloud, cudaStream_t stream);

/// Energies of the cells, then of the motion of parted nodes [J].
void launch_front_energy(const CudaFront& front, const CudaNodes& state, double* energy,
                         cudaStream_t stream);
/// Marks the nodes that its cells push: kMarkedByFront in `marks`, one for each node.
void launch_mark_front(const CudaFront& front, std::uint8_t* marks, std::size_t node_count,
                       cudaStream_t stream);

}  // namespace tissue_sim
