#include <cuda_runtime.h>

#include "compute/for_each_cuda.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/contact_lanes.h"
#include "mpm/cuda/sweep_blade.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 256;

using Segment = SegmentOf<Vector3>;

/// A point of a block.
struct SweptPoint {
  std::int32_t point;
  int cell[3];  // in the block
  int sub;
};

/// Looks at the points of one block.
struct Sweep {
  const CudaTables& t;
  const CudaSweep& s;
  const CudaBlock& b;
  CudaBlockCell at;

  __device__ Segment bond(std::int32_t p, std::int32_t q) const {
    const auto place = [](const float* of, std::int32_t point) {
      const float* x = of + 3 * static_cast<std::size_t>(point);
      return Vector3(x[0], x[1], x[2]);
    };
    return {place(s.begin, p), place(s.begin, q), place(s.end, p), place(s.end, q)};
  }

  __device__ bool is_near(std::int32_t p) const {
    const Segment still = bond(p, p);
    for (int i = 0; i < s.edge_count; ++i) {
      if (!stays_aside(s.edges[i].edge, still, s.reach)) return true;
    }
    return false;
  }

  /// Whether an edge passes the bond, and where the first one does.
  __device__ bool passes(const Segment& all, MeetingOf<Vector3>& meeting) const {
    for (int i = 0; i < s.edge_count; ++i) {
      const CudaSweptEdge& e = s.edges[i];
      const Segment then = all.during(e.begin, e.end);
      if (!stays_aside(e.edge, then) && edge_passes(e.edge, then, &meeting)) return true;
    }
    return false;
  }

  /// See the host's, in mpm/sweep_bonds.cpp: a normal goes back by F^T.
  __device__ BrokenBond broken_bond(const SweptPoint& p, std::int32_t other, int axis,
                                    const MeetingOf<Vector3>& meeting) const {
    BrokenBond broken = {p.point, other, axis, {static_cast<float>(meeting.place), {}}};
    float place[3], F[9];
    for (int a = 0; a < 3; ++a) place[a] = (p.sub >> a & 1) != 0 ? 0.25f : -0.25f;
    place[axis] += 0.5f * broken.crossing.place;
    const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
    const int slot = b.first_slot + p.cell[2] * plane + p.cell[1] * pitch + p.cell[0];
    deformation_gradient(SlotField{t.slot_node + slot, pitch, plane, s.u},
                         s.lattices[at.lattice].cell_size, place, F);
    double normal[3] = {}, length = 0;
    for (int i = 0; i < 9; ++i) normal[i % 3] += F[i] * meeting.normal[i / 3];
    for (const double n : normal) length += n * n;
    length = sqrt(length);
    for (int a = 0; a < 3; ++a) broken.crossing.normal[a] = static_cast<float>(normal[a] / length);
    if (!(length > 0 && isfinite(length))) broken.crossing.place = -1;
    return broken;
  }

  __device__ void look_at(const SweptPoint& p) const {
    const CudaLattice& lattice = s.lattices[at.lattice];
    const int first[3] = {at.x, at.y, at.z};
    int site[3];
    for (int a = 0; a < 3; ++a) site[a] = 2 * (first[a] + p.cell[a]) + (p.sub >> a & 1);
    for (int axis = 0; axis < 3; ++axis) {
      if ((t.bonds[p.point] >> (kForwardBond + axis) & 1) == 0) continue;
      const int x = site[0] + (axis == 0), y = site[1] + (axis == 1), z = site[2] + (axis == 2);
      const std::size_t row = static_cast<std::size_t>(z) * lattice.sites_y + y;
      const std::int32_t other = s.point_at[lattice.first_site + row * lattice.sites_x + x];
      MeetingOf<Vector3> meeting;
      if (!passes(bond(p.point, other), meeting)) continue;
      const int i = atomicAdd(s.broken_count, 1);
      if (i < s.room) s.broken[i] = broken_bond(p, other, axis, meeting);
    }
  }
};

/// So many thread blocks for each block.
constexpr int kShares = 16;

__global__ void __launch_bounds__(kThreads) sweep_points(const CudaTables t, const CudaSweep s) {
  const CudaBlock b = t.blocks[blockIdx.x];
  const Sweep sweep{t, s, b, s.cells[blockIdx.x]};
  const int columns = b.nx * b.ny;
  const int first = static_cast<int>(blockIdx.y * kThreads + threadIdx.x);
  for (int i = first; i < 8 * columns * b.nz; i += kShares * kThreads) {
    const int column = i % columns, layer = i / columns;
    const SweptPoint p = {
        t.point[b.first_lane + i], {column % b.nx, column / b.nx, layer / 8}, layer % 8};
    if (p.point >= 0 && sweep.is_near(p.point)) sweep.look_at(p);
  }
}

struct ChangePoints {
  const CudaPointChange* changes;
  CudaChangedPoints of;
  __device__ void operator()(int i) const {
    const CudaPointChange& c = changes[i];
    of.bonds[c.point] = c.bonds;
    if (of.soft != nullptr) of.soft[c.point] = c.soft;
    if (of.lightness != nullptr && c.whole == 0 && of.lightness[c.point] > 0) {
      of.lightness[c.point] = 1;
    }
    if (of.outer == nullptr) return;
    const float4 was = of.outer[c.point], is = c.outer.place;
    if (was.x == is.x && was.y == is.y && was.z == is.z && was.w == is.w) return;
    of.outer[c.point] = is;
    of.area[c.point] = c.outer.area;
    if (of.planes != nullptr) of.planes[c.point] = c.outer.plane;
    std::uint8_t* const with = of.with + static_cast<std::size_t>(c.point) * of.held;
    for (int k = 0; k < of.held; ++k) with[k] = 0;
  }
};

}  // namespace

void launch_sweep(const CudaTables& tables, const CudaSweep& sweep, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(sweep.broken_count, 0, sizeof(int), stream), "clear memory");
  sweep_points<<<dim3(tables.block_count, kShares), kThreads, 0, stream>>>(tables, sweep);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_change_points(const CudaPointChange* changes, int count, const CudaChangedPoints& of,
                          cudaStream_t stream) {
  Gpu(stream).for_each(count, ChangePoints{changes, of});
}

}  // namespace tissue_sim
