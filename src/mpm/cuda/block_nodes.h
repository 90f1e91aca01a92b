// A block's nodes in shared memory. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Force on the node of a slot: the sum of its parts, always in the same order.
__device__ __forceinline__ float4 node_force(const CudaTables& t, const float4* force, int slot) {
  const std::uint32_t shared = t.slot_parts[slot];
  if (shared == 0) return __ldcg(force + slot);
  float4 f = {0, 0, 0, 0};
  const std::uint32_t* part = t.parts + (shared >> 6);
  const int count = static_cast<int>(shared & 63u);
#pragma unroll 4
  for (int i = 0; i < count; ++i) {
    const float4 p = __ldcg(force + part[i]);
    f.x += p.x;
    f.y += p.y;
    f.z += p.z;
  }
  return f;
}

/// Brings the nodes of a block into `u` and, where `v` is not null, `v` (divided by the cell size,
/// so that stencils give gradients). With `kMove` it first moves them on by the forces of the last
/// substep; every block that has a node computes the same, and the one that owns it writes it down.
template <bool kMove>
__device__ __forceinline__ void bring_nodes(const CudaTables& t, const CudaBlock& b,
                                            const CudaNodes& from, const CudaNodes& to,
                                            const float4* force, const NodeStep& step, float scale,
                                            float4* u_out, float4* v_out) {
  const int count = b.slots();
#pragma unroll 2
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    const int slot = b.first_slot + i;
    const std::int32_t entry = t.slot_node[slot];
    const std::int32_t node = entry < 0 ? ~entry : entry;
    float4 u = __ldcg(from.u + node), v = __ldcg(from.v + node);
    if (kMove) {
      const float4 f = node_force(t, force, slot);
      step.move(0, f.x, u.w, v.w, u.x, v.x);
      step.move(1, f.y, u.w, v.w, u.y, v.y);
      step.move(2, f.z, u.w, v.w, u.z, v.z);
      if (entry >= 0) {
        __stcg(to.u + node, u);
        __stcg(to.v + node, v);
      }
    }
    u_out[i] = {scale * u.x, scale * u.y, scale * u.z, 0};
    if (v_out != nullptr) v_out[i] = {scale * v.x, scale * v.y, scale * v.z, 0};
  }
}

/// Lane of the point at sub-position s of cell (x, y, z).
__device__ __forceinline__ int lane_of(const CudaBlock& b, int x, int y, int z, int s) {
  return b.first_lane + ((z * 8 + s) * b.ny + y) * b.nx + x;
}

/// Reference place of that point [m].
__device__ __forceinline__ void reference_place(const CudaBlock& b, float cell_size, int x, int y,
                                                int z, int s, float (&place)[3]) {
  place[0] = b.origin[0] + cell_size * (x + ((s & 1) != 0 ? 1.25f : 0.75f));
  place[1] = b.origin[1] + cell_size * (y + ((s & 2) != 0 ? 1.25f : 0.75f));
  place[2] = b.origin[2] + cell_size * (z + ((s & 4) != 0 ? 1.25f : 0.75f));
}

}  // namespace tissue_sim
