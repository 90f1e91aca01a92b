#include <cuda_runtime.h>

#include "compute/cuda_check.h"
#include "compute/for_each_cuda.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/near_cells.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 128, kCellThreads = 512;

/// The colliders, as bits, that come within `margin` of the box from `min` to `max`; `among` those.
__device__ __forceinline__ std::uint32_t met_by(const CudaReach& reach, std::uint32_t among,
                                                const float* min, const float* max, float margin) {
  std::uint32_t met = 0;
  for (std::uint32_t left = among; left != 0; left &= left - 1) {
    const CudaBox& swept = reach.swept[__ffs(static_cast<int>(left)) - 1];
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      meets = meets && min[a] - margin <= swept.max[a] && swept.min[a] <= max[a] + margin;
    }
    if (meets) met |= left & (0u - left);
  }
  return met;
}

__device__ __forceinline__ std::uint32_t all_of(const CudaReach& reach) {
  return reach.collider_count < 32 ? (1u << reach.collider_count) - 1 : ~0u;
}

/// Reference place of the middle of a block's cell (x, y, z) [m].
__device__ __forceinline__ void middle_of(const CudaBlock& b, float cell_size, int x, int y, int z,
                                          float (&middle)[3]) {
  const int at[3] = {x, y, z};
  for (int a = 0; a < 3; ++a) {
    middle[a] = b.origin[a] + cell_size * static_cast<float>(at[a] + 1);
  }
}

__global__ void unmark(const CudaNearCells out) {
  const std::size_t i = static_cast<std::size_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i == 0) *out.count = 0;
  if (i < out.node_count) out.marks[i] &= ~kMarkedByTools;
}

/// One thread block for each block.
__global__ void __launch_bounds__(kCellThreads)
    list_cells(const CudaTables t, const CudaNodes state, const CudaMeasure* measures,
               const CudaReach reach, const CudaNearCells out) {
  const CudaBlock b = t.blocks[blockIdx.x];
  const CudaMeasure& m = measures[blockIdx.x];
  const float cell_size = t.bodies[b.body].cell_size;
  const float margin = m.speed * reach.duration + reach.margin;
  // Where cells go besides, their block is no guide.
  const std::uint32_t block_near =
      reach.went != nullptr ? all_of(reach) : met_by(reach, all_of(reach), m.min, m.max, margin);
  for (int i = static_cast<int>(threadIdx.x); i < b.nx * b.ny * b.nz; i += kCellThreads) {
    const int x = i % b.nx, y = i / b.nx % b.ny, z = i / (b.nx * b.ny);
    CudaNearCell cell;
    cell.pitch = b.nx + 2;
    cell.plane = cell.pitch * (b.ny + 2);
    cell.slot = b.first_slot + z * cell.plane + y * cell.pitch + x;
    cell.lane = lane_of(b, x, y, z, 0);
    cell.step = b.nx * b.ny;
    cell.body = b.body;
    bool has_points = false, is_cut = false;
    for (int s = 0; s < 8; ++s) {
      const int p = t.point[cell.lane + s * cell.step];
      has_points = has_points || p >= 0;
      is_cut = is_cut || (p >= 0 && t.bonds[p] != kAllBonds);
    }
    if (!has_points) continue;
    const auto node_of = [&](int slot) {
      const std::int32_t entry = t.slot_node[slot];
      return entry < 0 ? ~entry : entry;
    };
    cell.near = block_near & (is_cut ? ~0u : ~reach.blades);
    if (cell.near != 0) {
      cell.node = node_of(cell.slot + cell.plane + cell.pitch + 1);
      const float4 u = state.u[cell.node], then = reach.went != nullptr ? reach.went[cell.node] : u;
      const float moved[3] = {u.x, u.y, u.z}, moved_then[3] = {then.x, then.y, then.z};
      float min[3], max[3];
      middle_of(b, cell_size, x, y, z, cell.middle);
      for (int a = 0; a < 3; ++a) {
        min[a] = cell.middle[a] + fminf(moved[a], moved_then[a]);
        max[a] = cell.middle[a] + fmaxf(moved[a], moved_then[a]);
      }
      cell.near = met_by(reach, cell.near, min, max, margin + kCellReach * cell_size);
      out.listed[b.first_lane / 8 + i] = cell.near;
    }
    const int held = t.place_parts * t.held_by;
    for (int k = 0; k < 8 * held; ++k) {
      const int p = t.point[cell.lane + k / held * cell.step];
      if (p < 0) continue;
      std::uint8_t& with = t.with[static_cast<std::size_t>(p) * held + k % held];
      if (with != 0 && (cell.near >> (with - 1) & 1u) == 0) with = 0;
    }
    if (cell.near == 0) continue;
    out.cells[atomicAdd(out.count, 1)] = cell;
    for (int k = 0; k < 27; ++k) {
      const int n = node_of(cell.slot + k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3);
      out.marks[n] |= kMarkedByTools;
    }
  }
}

__global__ void mark_slots(const CudaTables t, const std::uint8_t* marks,
                           std::uint32_t* pushed_parts, std::size_t slot_count) {
  const std::size_t slot = static_cast<std::size_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (slot < slot_count) mark_slot(t.slot_node, t.slot_parts, marks, slot, pushed_parts);
}

/// One thread block for each block. Points lie within a cell's length of its middle, where it is
/// not stretched much.
__global__ void __launch_bounds__(kCellThreads)
    find_missed(const CudaTables t, const CudaNodes state, const CudaMeasure* measures,
                const CudaReach reach, const std::uint32_t* listed, int* missed) {
  const CudaBlock b = t.blocks[blockIdx.x];
  const CudaMeasure& m = measures[blockIdx.x];
  const float cell_size = t.bodies[b.body].cell_size;
  const std::uint32_t near = met_by(reach, all_of(reach) & ~reach.blades, m.min, m.max, 0);
  if (near == 0) return;
  for (int i = static_cast<int>(threadIdx.x); i < b.nx * b.ny * b.nz; i += kCellThreads) {
    const int x = i % b.nx, y = i / b.nx % b.ny, z = i / (b.nx * b.ny);
    const int plane = (b.nx + 2) * (b.ny + 2);
    const std::int32_t entry =
        t.slot_node[b.first_slot + (z + 1) * plane + (y + 1) * (b.nx + 2) + x + 1];
    const float4 u = state.u[entry < 0 ? ~entry : entry];
    const float moved[3] = {u.x, u.y, u.z};
    float now[3];
    middle_of(b, cell_size, x, y, z, now);
    for (int a = 0; a < 3; ++a) now[a] += moved[a];
    const std::uint32_t met = met_by(reach, near, now, now, cell_size);
    if ((met & ~listed[b.first_lane / 8 + i]) == 0) continue;
    for (int s = 0; s < 8; ++s) {
      if (t.point[lane_of(b, x, y, z, s)] >= 0) *missed = 1;
    }
  }
}

unsigned blocks_for(std::size_t n) { return static_cast<unsigned>((n + kThreads - 1) / kThreads); }

struct ListHeld {
  const std::uint8_t* with;
  const float4* hold;
  HeldPoint* held;
  int most;
  int* count;
  __device__ void operator()(int i) const {
    if (with[i] == 0) return;
    const int at = atomicAdd(count, 1);
    if (at >= most) return;
    const float4 h = hold[i];
    held[at] = {i, with[i], {h.x, h.y, h.z, h.w}};
  }
};

struct HoldAgain {
  const HeldPoint* held;
  std::uint8_t* with;
  float4* hold;
  __device__ void operator()(int i) const {
    const HeldPoint& p = held[i];
    with[p.entry] = p.with;
    hold[p.entry] = {p.hold[0], p.hold[1], p.hold[2], p.hold[3]};
  }
};

}  // namespace

void launch_near(const CudaTables& tables, const CudaNodes& state, const CudaMeasure* measures,
                 const CudaReach& reach, const CudaNearCells& near, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(near.listed, 0, near.cell_count * sizeof(std::uint32_t), stream),
             "clear memory");
  unmark<<<blocks_for(near.node_count), kThreads, 0, stream>>>(near);
  list_cells<<<tables.block_count, kCellThreads, 0, stream>>>(tables, state, measures, reach, near);
  launch_mark_slots(tables, near.marks, near.pushed_parts, near.slot_count, stream);
}

void launch_mark_slots(const CudaTables& tables, const std::uint8_t* marks,
                       std::uint32_t* pushed_parts, std::size_t slot_count, cudaStream_t stream) {
  mark_slots<<<blocks_for(slot_count), kThreads, 0, stream>>>(tables, marks, pushed_parts,
                                                              slot_count);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_missed(const CudaTables& tables, const CudaNodes& state, const CudaMeasure* measures,
                   const CudaReach& reach, const std::uint32_t* listed, int* missed,
                   cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(missed, 0, sizeof(int), stream), "clear memory");
  find_missed<<<tables.block_count, kCellThreads, 0, stream>>>(tables, state, measures, reach,
                                                               listed, missed);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_list_held(const std::uint8_t* with, const float4* hold, int entries, HeldPoint* held,
                      int most, int* count, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(count, 0, sizeof(int), stream), "clear memory");
  Gpu(stream).for_each(entries, ListHeld{with, hold, held, most, count});
}

void launch_hold_again(const HeldPoint* held, int count, std::uint8_t* with, float4* hold,
                       cudaStream_t stream) {
  Gpu(stream).for_each(count, HoldAgain{held, with, hold});
}

}  // namespace tissue_sim
