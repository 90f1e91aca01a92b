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

/// Fills what entries of CudaHeldFaces have of the tables.
void launch_connect_entries(CudaFaceEntry* entries, int count, const std::int32_t* slot_node,
                            const std::uint32_t* slot_parts, const uint4* first_parts,
                            cudaStream_t stream);
/// The same of CudaHeldFaces::held.
void launch_connect_held(CudaHeldNode* held, int count, const CudaTables& tables,
                         cudaStream_t stream);

/// As hold_still() of mpm/anchors/anchor_faces.h does for each of `count` groups.
void launch_hold_still(const CudaRowGroup* groups, int count, const CudaRowNodes* rows,
                       const float* inverse, float4* field, cudaStream_t stream);

}  // namespace tissue_sim
