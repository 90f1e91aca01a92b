// Takes out of a field of all nodes what anchors' faces hold: for the substep that tissue bears.
#pragma once

#include <cuda_runtime_api.h>
#include <vector_types.h>

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// FaceRow without its place.
struct CudaRowNodes {
  std::int32_t node[kFaceRowNodes];
  float weight[kFaceRowNodes], share[kFaceRowNodes];
};
/// FaceGroup.
struct CudaRowGroup {
  int first, count, inverse;
};

/// Fills what CudaHeldFaces::held and ::entries have of the tables.
void launch_connect(CudaHeldNode* held, int count, const CudaTables& tables, cudaStream_t stream);
void launch_connect(CudaFaceEntry* entries, int count, const CudaTables& tables,
                    cudaStream_t stream);

/// As hold_still() of mpm/anchors/anchor_faces.h does for each of `count` groups.
void launch_hold_still(const CudaRowGroup* groups, int count, const CudaRowNodes* rows,
                       const float* inverse, float4* field, cudaStream_t stream);

}  // namespace tissue_sim
