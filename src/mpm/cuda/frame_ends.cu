#include <cuda_runtime.h>

#include "compute/cuda_check.h"
#include "material/laws.h"
#include "mpm/cuda/block_nodes.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/half_cell.h"
#include "mpm/cuda/measure_sums.h"
#include "mpm/cuda/node_plane.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

int threads_for(int max_slots) { return max_slots > 1024 ? kMostThreads : 128; }

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

/// Calls f(lane, s, x, y, z, half plane of the nodes' values) for each point of the block, for the
/// four of a half cell in code of their own: so what they share is worked out once.
template <class F>
__device__ __forceinline__ void for_each_point(const CudaTables& t, const CudaBlock& b,
                                               const float4* nodes, const F& f) {
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const int halves = 2 * b.nx * b.ny * b.nz;
  for (int i = threadIdx.x; i < halves; i += blockDim.x) {
    const int row = i / b.nx, x = i - row * b.nx, layer = row / b.ny, y = row - layer * b.ny;
    const int z = layer / 2, sz = layer % 2;
    HalfPlane h[3];
    const int first = z * plane + y * pitch + x;
    read_half(nodes + first, pitch, plane, sz == 0 ? -1.0f : 1.0f, h);
#pragma unroll
    for (int q = 0; q < 4; ++q) {
      const int lane = lane_of(b, x, y, z, 4 * sz + q);
      if (b.whole != 0 || t.point[lane] >= 0) f(lane, 4 * sz + q, x, y, z, h);
    }
  }
}

/// Of the nodes that the block owns, a thread's share.
__device__ __forceinline__ double kinetic_energy(const CudaTables& t, const CudaBlock& b,
                                                 const CudaNodes& state) {
  constexpr int kHand = 4;
  double sum = 0;
  for (int i = threadIdx.x; i < b.slots(); i += kHand * blockDim.x) {
    std::int32_t node[kHand];
    float4 v[kHand];
    float mass[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int slot = i + k * static_cast<int>(blockDim.x);
      node[k] = slot < b.slots() ? __ldg(t.slot_node + b.first_slot + slot) : -1;
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const int owned = max(node[k], 0);
      v[k] = __ldcg(state.v + owned);
      mass[k] = node[k] < 0 ? 0 : __ldcg(&state.u[owned].w);
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      const double x = v[k].x, y = v[k].y, z = v[k].z;
      sum += 0.5 * mass[k] * (x * x + y * y + z * z);
    }
  }
  return sum;
}

__global__ void __launch_bounds__(kMostThreads)
    measure_blocks(const CudaTables t, const CudaNodes state, int max_slots, CudaMeasure* out) {
  extern __shared__ float4 shared[];
  const CudaBlock b = t.blocks[blockIdx.x];
  const CudaBody body = t.bodies[b.body];
  float4 *u = shared, *v = shared + max_slots;
  bring_nodes<false, false, 4>(t, b.first_slot, b.slots(), {}, state, state, nullptr, {},
                               placed_scale(body), u, v);
  CudaMeasure m = of_nothing();
  m.kinetic_energy = kinetic_energy(t, b, state);
  __syncthreads();
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const float kept = t.lightness == nullptr ? 0 : kept_volume(body.cell_size);
  for_each_point(t, b, u, [&](int lane, int s, int x, int y, int z, const HalfPlane(&h)[3]) {
    const PointState p = point_state(b, body, h, x, y, z, s);
    for (int c = 0; c < 3; ++c) {
      m.min[c] = fminf(m.min[c], p.x[c]);
      m.max[c] = fmaxf(m.max[c], p.x[c]);
    }
    const float volume = b.whole != 0 ? body.point_volume : t.volume[lane];
    if (volume == 0) return;  // what an anchor holds has no stress
    float cof[9];
    cofactor(p.F, cof);
    const float J = p.F[0] * cof[0] + p.F[1] * cof[1] + p.F[2] * cof[2];
    const float elastic = body.neo_hookean != 0 ? energy<NeoHookean>(p.F, body.mu, body.lambda)
                                                : energy<FixedCorotated>(p.F, body.mu, body.lambda);
    float column = 0;
    for (int i = 0; i < 3; ++i) {
      column = fmaxf(column, cof[i] * cof[i] + cof[3 + i] * cof[3 + i] + cof[6 + i] * cof[6 + i]);
    }
    const float square = norm2(p.F);
    const float stiffening = column + fabsf(J - 1) * sqrtf(square / 3);
    if (!isfinite(elastic + stiffening)) m.finite = 0;
    m.elastic_energy += static_cast<double>(elastic) * volume;
    if (b.whole == 0 && volume <= kept) return;
    const bool is_soft = t.soft != nullptr && t.soft[t.point[lane]] != 0;
    const float lightness = t.lightness != nullptr ? t.lightness[t.point[lane]] : 1;
    const auto lessened = [lightness](float value) { return 1 + lightness * (value - 1); };
    m.worst_stiffening = fmaxf(m.worst_stiffening, stiffening);  // not lessened, as on the CPU
    m.square = fmaxf(m.square, lessened(square));
    m.stiffening = fmaxf(m.stiffening, lessened(is_soft ? kSoftness * stiffening : stiffening));
  });
  // The velocity of a point is the value of the nodes' velocities there.
  for_each_point(t, b, v, [&](int lane, int s, int, int, int, const HalfPlane(&h)[3]) {
    if (b.whole == 0 && t.volume[lane] == 0) return;
    float v2 = 0;
    for (int c = 0; c < 3; ++c) {
      const float sx = (s & 1) != 0 ? 1.0f : -1.0f, sy = (s & 2) != 0 ? 1.0f : -1.0f;
      const float velocity = point_value(h[c], sx, sy);
      v2 += velocity * velocity;
    }
    if (!(v2 <= m.speed)) m.speed = v2;
  });
  m.speed = body.cell_size * sqrtf(m.speed);
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

/// The block of this thread block, whose displacements it brings.
__device__ __forceinline__ CudaBlock bring_block(const CudaTables& t, const CudaNodes& state,
                                                 float4* u) {
  const CudaBlock b = t.blocks[blockIdx.x];
  bring_nodes<false, false, 4>(t, b.first_slot, b.slots(), {}, state, state, nullptr, {},
                               placed_scale(t.bodies[b.body]), u, nullptr);
  __syncthreads();
  return b;
}

__global__ void __launch_bounds__(kMostThreads)
    write_cloud(const CudaTables t, const CudaNodes state, const CudaCloud cloud) {
  extern __shared__ float4 shared[];
  const CudaBlock b = bring_block(t, state, shared);
  const CudaBody body = t.bodies[b.body];
  for_each_point(t, b, shared, [&](int lane, int s, int x, int y, int z, const HalfPlane(&h)[3]) {
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

__global__ void write_held(const AnchoredPoint* held, int count, Point* cloud) {
  const int i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= count || held[i].index < 0) return;
  Point& point = cloud[held[i].index];
  point.x = held[i].x[0];
  point.y = held[i].x[1];
  point.z = held[i].x[2];
  point.stress = 0;
}

__global__ void __launch_bounds__(kMostThreads)
    write_places(const CudaTables t, const CudaNodes state, float* places) {
  extern __shared__ float4 shared[];
  const CudaBlock b = bring_block(t, state, shared);
  const CudaBody body = t.bodies[b.body];
  for_each_point(t, b, shared, [&](int lane, int s, int x, int y, int z, const HalfPlane(&h)[3]) {
    const PointState p = point_state(b, body, h, x, y, z, s);
    float* place = places + 3 * static_cast<std::size_t>(t.point[lane]);
    for (int a = 0; a < 3; ++a) place[a] = p.x[a];
  });
}

/// The test of BlockKernels::stretched: s^2 I - C is not positive definite.
__global__ void __launch_bounds__(kMostThreads)
    list_stretched(const CudaTables t, const CudaNodes state, float share, StretchedPoint* found,
                   int room, int* count) {
  extern __shared__ float4 shared[];
  const CudaBlock b = bring_block(t, state, shared);
  const CudaBody body = t.bodies[b.body];
  if (body.tear_stretch == 0) return;
  // At 1 exactly the limit.
  const float stretch = share == 1 ? body.tear_stretch : 1 + share * (body.tear_stretch - 1);
  const float s2 = stretch * stretch;
  for_each_point(t, b, shared, [&](int lane, int s, int x, int y, int z, const HalfPlane(&h)[3]) {
    const PointState p = point_state(b, body, h, x, y, z, s);
    StretchedPoint out;
    out.point = t.point[lane];
    right_cauchy_green(p.F, out.C);
    const float* C = out.C;
    const float m0 = s2 - C[0], m1 = s2 - C[1], m2 = s2 - C[2];
    const float minor = m0 * m1 - C[3] * C[3];
    const float det = m2 * minor - m0 * C[5] * C[5] - m1 * C[4] * C[4] - 2.0f * C[3] * C[4] * C[5];
    if (m0 > 0 && minor > 0 && det > 0) return;
    const int i = atomicAdd(count, 1);
    if (i < room) found[i] = out;
  });
}

/// Starts a kernel with one thread block for each block and room for so many numbers of each node.
template <class... Parameters, class... Arguments>
void launch(void (*kernel)(CudaTables, CudaNodes, Parameters...), int numbers, int max_slots,
            const CudaTables& tables, const CudaNodes& state, cudaStream_t stream,
            const Arguments&... arguments) {
  const std::size_t bytes = numbers * sizeof(float) * max_slots;
  check_cuda(
      cudaFuncSetAttribute(reinterpret_cast<const void*>(kernel),
                           cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)),
      "be set up");
  kernel<<<tables.block_count, threads_for(max_slots), bytes, stream>>>(tables, state,
                                                                        arguments...);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace

void launch_measure(const CudaTables& tables, const CudaNodes& state, int max_slots,
                    CudaMeasure* measures, cudaStream_t stream) {
  launch(measure_blocks, 8, max_slots, tables, state, stream, max_slots, measures);
}

void launch_stretched(const CudaTables& tables, const CudaNodes& state, int max_slots, float share,
                      StretchedPoint* found, int room, int* count, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(count, 0, sizeof(int), stream), "clear memory");
  launch(list_stretched, 4, max_slots, tables, state, stream, share, found, room, count);
}

void launch_places(const CudaTables& tables, float4* u, int max_slots, float* places,
                   cudaStream_t stream) {
  launch(write_places, 4, max_slots, tables, {u, nullptr}, stream, places);
}

void launch_cloud(const CudaTables& tables, const CudaNodes& state, int max_slots,
                  const CudaCloud& cloud, cudaStream_t stream) {
  launch(write_cloud, 4, max_slots, tables, state, stream, cloud);
}

void launch_anchored(const AnchoredPoint* held, int count, Point* cloud, cudaStream_t stream) {
  if (count == 0) return;
  write_held<<<(count + 255) / 256, 256, 0, stream>>>(held, count, cloud);
  check_cuda(cudaGetLastError(), "write a cloud");
}

}  // namespace tissue_sim
