#include <cuda_runtime.h>

#include "compute/cuda_check.h"
#include "material/laws.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/cell_stabilisation.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/half_cell.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 128;

/// A point's deformation gradient and place, from its half plane.
struct PointState {
  float F[9], x[3];
};
__device__ __forceinline__ PointState point_state(const CudaBlock& b, const CudaBody& body,
                                                  const HalfPlane (&h)[3], int x, int y, int z,
                                                  int s) {
  PointState p;
  const float sx = (s & 1) != 0 ? 1.0f : -1.0f, sy = (s & 2) != 0 ? 1.0f : -1.0f;
  reference_place(b, body.cell_size, x, y, z, s, p.x);
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    float low[3], high[3];
    row_of_F(h[c], c, (s & 4) != 0 ? 1.0f : -1.0f, sy, low, high);
#pragma unroll
    for (int i = 0; i < 3; ++i) p.F[3 * c + i] = sx < 0 ? low[i] : high[i];
    p.x[c] += body.cell_size * point_value(h[c], sx, sy);
  }
  return p;
}

/// Calls f(lane, s, x, y, z, half plane of u) for each point of the block.
template <class F>
__device__ __forceinline__ void for_each_point(const CudaTables& t, const CudaBlock& b,
                                               const float4* u, const F& f) {
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const int halves = 2 * b.nx * b.ny * b.nz;
  for (int i = threadIdx.x; i < halves; i += blockDim.x) {
    const int x = i % b.nx, y = i / b.nx % b.ny, z = i / b.nx / b.ny / 2;
    const int sz = i / b.nx / b.ny % 2;
    HalfPlane h[3];
    const int first = z * plane + y * pitch + x;
    read_half(u + first, pitch, plane, sz == 0 ? -1.0f : 1.0f, h);
    for (int q = 0; q < 4; ++q) {
      const int lane = lane_of(b, x, y, z, 4 * sz + q);
      if (t.point[lane] >= 0) f(lane, 4 * sz + q, x, y, z, first, h);
    }
  }
}

/// Sums, least and largest over the threads of a block, in a fixed order.
__device__ void reduce(CudaMeasure& m) {
  __shared__ CudaMeasure all[kThreads];
  all[threadIdx.x] = m;
  for (int step = kThreads / 2; step > 0; step /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) >= step) continue;
    CudaMeasure& a = all[threadIdx.x];
    const CudaMeasure& b = all[threadIdx.x + step];
    a.elastic_energy += b.elastic_energy;
    a.kinetic_energy += b.kinetic_energy;
    for (int i = 0; i < 3; ++i) {
      a.min[i] = fminf(a.min[i], b.min[i]);
      a.max[i] = fmaxf(a.max[i], b.max[i]);
    }
    if (!(b.speed <= a.speed)) a.speed = b.speed;  // NaN stays
    a.stiffening = fmaxf(a.stiffening, b.stiffening);
    a.wildest = fmaxf(a.wildest, b.wildest);
    a.finite = a.finite & b.finite;
  }
  if (threadIdx.x == 0) m = all[0];
}

__global__ void __launch_bounds__(kThreads)
    measure_blocks(const CudaTables t, const CudaNodes state, int max_slots, CudaMeasure* out) {
  extern __shared__ float4 shared[];
  const CudaBlock& b = t.blocks[blockIdx.x];
  const CudaBody& body = t.bodies[b.body];
  float4 *u = shared, *v = shared + max_slots;
  bring_nodes<false, false, 4>(t, b.first_slot, b.slots(), {}, state, state, nullptr, {},
                               body.inv_cell_size, u, v);
  CudaMeasure m = {0, 0, {1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, 0, 1, 1, 1};
  for (int i = threadIdx.x; i < b.slots(); i += blockDim.x) {
    const int node = t.slot_node[b.first_slot + i];
    if (node < 0) continue;
    const float4 w = __ldcg(state.v + node);
    const double v2 = static_cast<double>(w.x) * w.x + static_cast<double>(w.y) * w.y +
                      static_cast<double>(w.z) * w.z;
    m.kinetic_energy += 0.5 * __ldcg(state.u + node).w * v2;
  }
  __syncthreads();
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  for_each_point(
      t, b, u, [&](int lane, int s, int x, int y, int z, int first, const HalfPlane(&h)[3]) {
        const PointState p = point_state(b, body, h, x, y, z, s);
        float cof[9], velocity[3];
        cofactor(p.F, cof);
        const float J = p.F[0] * cof[0] + p.F[1] * cof[1] + p.F[2] * cof[2];
        const float energy = body.neo_hookean != 0
                                 ? NeoHookean::energy(p.F, body.mu, body.lambda)
                                 : FixedCorotated::energy(p.F, body.mu, body.lambda);
        float column = 0;
        for (int i = 0; i < 3; ++i) {
          column =
              fmaxf(column, cof[i] * cof[i] + cof[3 + i] * cof[3 + i] + cof[6 + i] * cof[6 + i]);
        }
        const float stiffening = column + fabsf(J - 1) * sqrtf(norm2(p.F) / 3);
        if (!isfinite(energy + stiffening)) m.finite = 0;
        const float volume = b.whole != 0 ? body.point_volume : t.volume[lane];
        m.elastic_energy += static_cast<double>(energy) * volume;
        m.wildest = fmaxf(m.wildest, stiffening);
        const bool is_soft = t.soft != nullptr && t.soft[t.point[lane]] != 0;
        m.stiffening = fmaxf(m.stiffening, is_soft ? kSoftness * stiffening : stiffening);
        // The velocity of a point is the value of the nodes' velocities there.
        float v2 = 0;
        for (int c = 0; c < 3; ++c) velocity[c] = 0;
        for (int k = 0; k < 27; ++k) {
          const float4 at = v[first + k / 9 * plane + k / 3 % 3 * pitch + k % 3];
          const float w = body.cell_size * lattice_weight(s & 1, k % 3) *
                          lattice_weight(s >> 1 & 1, k / 3 % 3) * lattice_weight(s >> 2, k / 9);
          velocity[0] += w * at.x;
          velocity[1] += w * at.y;
          velocity[2] += w * at.z;
        }
        for (int c = 0; c < 3; ++c) {
          v2 += velocity[c] * velocity[c];
          m.min[c] = fminf(m.min[c], p.x[c]);
          m.max[c] = fmaxf(m.max[c], p.x[c]);
        }
        const float speed = sqrtf(v2);
        if (!(speed <= m.speed)) m.speed = speed;
      });
  for (int i = threadIdx.x; b.partial != 0 && i < b.nx * b.ny * b.nz; i += blockDim.x) {
    const float mu = t.partial[b.first_lane / 8 + i];
    if (mu == 0) continue;
    const int x = i % b.nx, y = i / b.nx % b.ny, z = i / b.nx / b.ny;
    for (int c = 0; c < 3; ++c) {
      m.elastic_energy += 0.5 * stabilising_energy2(u + z * plane + y * pitch + x, pitch, plane, c,
                                                    kStabilisation * mu);
    }
  }
  reduce(m);
  if (threadIdx.x == 0) out[blockIdx.x] = m;
}

__global__ void __launch_bounds__(kThreads)
    write_cloud(const CudaTables t, const CudaNodes state, const CudaCloud cloud) {
  extern __shared__ float4 shared[];
  const CudaBlock& b = t.blocks[blockIdx.x];
  const CudaBody& body = t.bodies[b.body];
  bring_nodes<false, false, 4>(t, b.first_slot, b.slots(), {}, state, state, nullptr, {},
                               body.inv_cell_size, shared, nullptr);
  __syncthreads();
  for_each_point(
      t, b, shared, [&](int lane, int s, int x, int y, int z, int, const HalfPlane(&h)[3]) {
        const int p = t.point[lane];
        const int place = cloud.place != nullptr  ? cloud.place[p]
                          : p % cloud.stride == 0 ? p / cloud.stride
                                                  : -1;
        if (place < 0) return;
        const PointState state_of_point = point_state(b, body, h, x, y, z, s);
        float P[9];
        if (body.neo_hookean != 0) {
          stress<NeoHookean>(state_of_point.F, body.mu, body.lambda, P);
        } else {
          stress<FixedCorotated>(state_of_point.F, body.mu, body.lambda, P);
        }
        const int piece = cloud.piece[p];
        const int whole = cloud.whole[p];
        Point out;
        out.x = state_of_point.x[0];
        out.y = state_of_point.x[1];
        out.z = state_of_point.x[2];
        out.rgb = cloud.colour[piece];
        out.id = static_cast<std::uint32_t>(p);
        out.fragment = piece;
        out.stress = sqrtf(von_mises_squared(state_of_point.F, P));
        out.damage = whole > 0 ? 1.0f - static_cast<float>(__popc(t.bonds[p])) / whole : 0.0f;
        cloud.points[place] = out;
      });
}

/// The test of BlockKernels::stretched: s^2 I - C is not positive definite.
__global__ void __launch_bounds__(kThreads)
    list_stretched(const CudaTables t, const CudaNodes state, StretchedPoint* found, int* count) {
  extern __shared__ float4 shared[];
  const CudaBlock& b = t.blocks[blockIdx.x];
  const CudaBody& body = t.bodies[b.body];
  if (body.tear_stretch == 0) return;
  bring_nodes<false, false, 4>(t, b.first_slot, b.slots(), {}, state, state, nullptr, {},
                               body.inv_cell_size, shared, nullptr);
  __syncthreads();
  const float s2 = body.tear_stretch * body.tear_stretch;
  for_each_point(t, b, shared,
                 [&](int lane, int s, int x, int y, int z, int, const HalfPlane(&h)[3]) {
                   const PointState p = point_state(b, body, h, x, y, z, s);
                   StretchedPoint out;
                   out.point = t.point[lane];
                   right_cauchy_green(p.F, out.C);
                   const float* C = out.C;
                   const float m0 = s2 - C[0], m1 = s2 - C[1], m2 = s2 - C[2];
                   const float minor = m0 * m1 - C[3] * C[3];
                   const float det =
                       m2 * minor - m0 * C[5] * C[5] - m1 * C[4] * C[4] - 2.0f * C[3] * C[4] * C[5];
                   if (m0 > 0 && minor > 0 && det > 0) return;
                   found[atomicAdd(count, 1)] = out;
                 });
}

/// Allows a kernel this much dynamic shared memory.
template <class Kernel>
void allow(Kernel kernel, std::size_t bytes) {
  check_cuda(
      cudaFuncSetAttribute(reinterpret_cast<const void*>(kernel),
                           cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)),
      "be set up");
}

}  // namespace

void launch_measure(const CudaTables& tables, const CudaNodes& state, int max_slots,
                    CudaMeasure* measures, cudaStream_t stream) {
  const std::size_t bytes = 2 * sizeof(float4) * max_slots;
  allow(measure_blocks, bytes);
  measure_blocks<<<tables.block_count, kThreads, bytes, stream>>>(tables, state, max_slots,
                                                                  measures);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_stretched(const CudaTables& tables, const CudaNodes& state, int max_slots,
                      StretchedPoint* found, int* count, cudaStream_t stream) {
  const std::size_t bytes = sizeof(float4) * max_slots;
  allow(list_stretched, bytes);
  check_cuda(cudaMemsetAsync(count, 0, sizeof(int), stream), "clear memory");
  list_stretched<<<tables.block_count, kThreads, bytes, stream>>>(tables, state, found, count);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_cloud(const CudaTables& tables, const CudaNodes& state, int max_slots,
                  const CudaCloud& cloud, cudaStream_t stream) {
  const std::size_t bytes = sizeof(float4) * max_slots;
  allow(write_cloud, bytes);
  write_cloud<<<tables.block_count, kThreads, bytes, stream>>>(tables, state, cloud);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
