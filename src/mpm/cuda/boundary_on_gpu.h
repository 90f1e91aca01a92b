// The surface of tissue that lives on a GPU, there: its corners, and what presses on them.
#pragma once

#include <cstdint>

#include "mpm/cuda/tables.h"
#include "mpm/surface/boundary_mesh.h"

namespace tissue_sim {

/// BoundaryMesh, and its support, as they were `made`.
struct BoundaryOnGpu {
  std::uint64_t made = 0, support_made = 0;
  DeviceArray<BoundaryMesh::Vertex> vertices;
  DeviceArray<int4> faces;  ///< their vertices
  DeviceArray<float> places, corners;
  PinnedArray<float> host_places;

  DeviceArray<std::int32_t> corner_begin, corner, node, begin, vertex, weak_of;
  DeviceArray<float> share;
  DeviceArray<BoundaryMesh::Support::Weak> weak;
  DeviceArray<BoundaryMesh::Support::Neighbour> around;
  /// Impulses on vertices, three numbers each, in kImpulseUnit, so that the order does not count;
  /// of the weak ones what is to be passed on now, and next.
  DeviceArray<unsigned long long> pushed, left, next;
};

/// Where nodes put vertices of a surface, three floats each [m].
void launch_boundary_places(const CudaNodes& nodes, const BoundaryMesh::Vertex* vertices, int count,
                            float* places, cudaStream_t stream);
/// Corners of two triangles a face.
void launch_boundary_corners(const BoundaryOnGpu& of, cudaStream_t stream);
/// push_surface() of mpm/state_figures.h; `impulses`: three numbers a triangle. What no block moves
/// must be the same in both states.
void launch_push_boundary(const BoundaryOnGpu& of, const float* impulses, const CudaNodes& nodes,
                          const CudaNodes& others, cudaStream_t stream);

}  // namespace tissue_sim
