// A block's nodes in shared memory. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Adds the parts of a shared node's force beyond the first, always in the same order.
__device__ __forceinline__ void add_parts(const CudaTables& t, const float4* force,
                                          std::uint32_t shared, float4& f) {
  const std::uint32_t* part = t.parts + (shared >> 6);
  const int count = static_cast<int>(shared & 63u);
#pragma unroll 4
  for (int i = 1; i < count; ++i) {
    const float4 p = __ldcg(force + part[i]);
    f.x += p.x;
    f.y += p.y;
    f.z += p.z;
  }
}

/// Brings the nodes of a block into `u` and, where `v` is not null, `v` (divided by the cell size,
/// so that stencils give gradients). With `kMove` it first moves them on by the forces of the last
/// substep; every block that has a node computes the same, and the one that owns it writes it down.
/// Each thread has several nodes in hand, for all their loads to be under way at once.
template <bool kMove>
__device__ __forceinline__ void bring_nodes(const CudaTables& t, const CudaBlock& b,
                                            const CudaNodes& from, const CudaNodes& to,
                                            const float4* force, const NodeStep& step, float scale,
                                            float4* u_out, float4* v_out) {
  constexpr int kHand = 4;
  const int count = b.slots(), threads = static_cast<int>(blockDim.x);
  for (int i = static_cast<int>(threadIdx.x); i < count; i += kHand * threads) {
    std::int32_t entry[kHand], node[kHand];
    std::uint32_t shared[kHand];
    float4 u[kHand], v[kHand], f[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int slot = b.first_slot + min(i + k * threads, count - 1);
      entry[k] = __ldg(t.slot_node + slot);
      shared[k] = kMove ? __ldg(t.slot_parts + slot) : 0;
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      node[k] = entry[k] < 0 ? ~entry[k] : entry[k];
      u[k] = __ldcg(from.u + node[k]);
      v[k] = __ldcg(from.v + node[k]);
      if (!kMove) continue;
      const std::uint32_t own = b.first_slot + min(i + k * threads, count - 1);
      f[k] = __ldcg(force + (shared[k] == 0 ? own : __ldg(t.parts + (shared[k] >> 6))));
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      if (i + k * threads >= count) break;
      if (kMove) {
        if (shared[k] != 0) add_parts(t, force, shared[k], f[k]);
        step.move(0, f[k].x, u[k].w, v[k].w, u[k].x, v[k].x);
        step.move(1, f[k].y, u[k].w, v[k].w, u[k].y, v[k].y);
        step.move(2, f[k].z, u[k].w, v[k].w, u[k].z, v[k].z);
        if (entry[k] >= 0) {
          __stcg(to.u + node[k], u[k]);
          __stcg(to.v + node[k], v[k]);
        }
      }
      const int at = i + k * threads;
      u_out[at] = {scale * u[k].x, scale * u[k].y, scale * u[k].z, 0};
      if (v_out != nullptr) v_out[at] = {scale * v[k].x, scale * v[k].y, scale * v[k].z, 0};
    }
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
