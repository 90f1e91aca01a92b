// Force of a block's points on its nodes, and of colliders on its points. For .cu files.
#pragma once

#include "material/laws.h"
#include "mpm/cuda/cell_stabilisation.h"
#include "mpm/cuda/half_cell.h"
#include "mpm/cuda/point_contact.h"

namespace tissue_sim {

/// What a block's threads share, in shared memory.
struct BlockShared {
  float4* u;                  ///< [slots], divided by the cell size
  float4* v;                  ///< [slots], the same; only where contact or viscosity needs it
  float4* exchange;           ///< [9][threads]
  unsigned long long* loads;  ///< [collider_count][6]
};

/// What one substep of a block needs beside its nodes.
struct BlockStep {
  const Collider* colliders;
  std::uint32_t near;
  float4* force;  ///< of all slots
};

/// Volumes of the points 2 sy + sx of a half cell.
__device__ __forceinline__ float4 half_volumes(const CudaTables& t, const CudaBlock& b,
                                               const CudaBody& body, int x, int y, int z, int sz) {
  if (b.whole != 0) {
    return {body.point_volume, body.point_volume, body.point_volume, body.point_volume};
  }
  const int step = b.nx * b.ny;
  const float* v = t.volume + lane_of(b, x, y, z, 4 * sz);
  return {v[0], v[step], v[2 * step], v[3 * step]};
}

/// F to the stress P times the volume, in place; `damping` is added.
template <class LawOf, bool kViscous>
__device__ __forceinline__ void stress(const CudaBody& body, float volume, const float* damping,
                                       float* F) {
  float P[9];
  LawOf::stress(F, body.mu * volume, body.lambda * volume, P);
#pragma unroll
  for (int i = 0; i < 9; ++i) F[i] = kViscous ? P[i] + damping[i] : P[i];
}

/// Kelvin-Voigt stress at the middle of the cell, from the mean gradients of its two halves, times
/// an eighth of the volume of its points. The neighbouring thread has the other half.
__device__ __forceinline__ void viscous_stress(const CudaBody& body, const HalfPlane (&u)[3],
                                               const HalfPlane (&v)[3], const float4& volume,
                                               float (&P)[9]) {
  const unsigned pair = 3u << (threadIdx.x & 30u);
  const auto mean = [pair](float half) { return 0.5f * (half + __shfl_xor_sync(pair, half, 1)); };
  float F[9], rate[9];
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    F[3 * c] = mean(0.5f * u[c].wdA);
    F[3 * c + 1] = mean(0.5f * u[c].wAd);
    F[3 * c + 2] = mean(u[c].sAA);
    rate[3 * c] = mean(0.5f * v[c].wdA);
    rate[3 * c + 1] = mean(0.5f * v[c].wAd);
    rate[3 * c + 2] = mean(v[c].sAA);
    F[4 * c] += 1.0f;
  }
  const float half = (volume.x + volume.y) + (volume.z + volume.w);
#pragma unroll
  for (int i = 0; i < 9; ++i) P[i] = 0;
  add_viscous_stress(F, rate, 0.25f * body.viscosity * mean(half), P);
}

/// Adds the forces of colliders on the points of half a cell to its transposed half plane.
__device__ __forceinline__ void add_contact(const CudaTables& t, const CudaBlock& b,
                                            const CudaBody& body, const BlockShared& s,
                                            const BlockStep& step, int x, int y, int z, int sz,
                                            const float4& volume, const HalfPlane (&h)[3],
                                            HalfPlane (&out)[3]) {
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const int first = z * plane + y * pitch + x;
  // Most half cells are far from everything: its points lie within two cells of its middle,
  // stretched as they may be.
  float middle[3];
  reference_place(b, body.cell_size, x, y, z, 4 * sz, middle);
#pragma unroll
  for (int c = 0; c < 3; ++c) middle[c] += body.cell_size * h[c].wAA;
  std::uint32_t close = 0;
  for (std::uint32_t left = step.near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    if (may_touch(step.colliders[c], middle, 2 * body.cell_size)) close |= 1u << c;
  }
  if (close == 0) return;
  // The stencils take forces by -1 / cell size, as they do stress.
  for (int q = 0; q < 4; ++q) {
    const int sub = 4 * sz + q;
    const int p = t.point[lane_of(b, x, y, z, sub)];
    if (p < 0) continue;
    const float side_x = (q & 1) != 0 ? 1.0f : -1.0f, side_y = (q & 2) != 0 ? 1.0f : -1.0f;
    float place[3];
    reference_place(b, body.cell_size, x, y, z, sub, place);
#pragma unroll
    for (int c = 0; c < 3; ++c) place[c] += body.cell_size * point_value(h[c], side_x, side_y);
    const float v = q == 0 ? volume.x : q == 1 ? volume.y : q == 2 ? volume.z : volume.w;
    const float3 push =
        contact_push(t, step.colliders, close, p, v, {place[0], place[1], place[2]}, body.spring,
                     s.v + first, pitch, plane, sub, body.cell_size, s.loads);
    add_point_force(-body.cell_size * push.x, side_x, side_y, out[0]);
    add_point_force(-body.cell_size * push.y, side_x, side_y, out[1]);
    add_point_force(-body.cell_size * push.z, side_x, side_y, out[2]);
  }
}

/// Forces of half a cell: reads its nodes, gives its transposed half plane.
template <class LawOf, bool kViscous, bool kSpecial>
__device__ __forceinline__ void half_forces(const CudaTables& t, const CudaBlock& b,
                                            const CudaBody& body, const BlockShared& s,
                                            const BlockStep& step, int x, int y, int z, int sz,
                                            const HalfWeights& weights, HalfPlane (&out)[3]) {
  const int pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const int first = z * plane + y * pitch + x;
  HalfPlane h[3], rate[3];
  read_half(s.u + first, pitch, plane, weights, h);
  if (kViscous) read_half(s.v + first, pitch, plane, weights, rate);
  const float4 volume = half_volumes(t, b, body, x, y, z, sz);
  float damping[9];
  if (kViscous) viscous_stress(body, h, rate, volume, damping);
#pragma unroll
  for (int c = 0; c < 3; ++c) out[c] = {};
#pragma unroll
  for (int ty = 0; ty < 2; ++ty) {
    const float side = ty == 0 ? -1.0f : 1.0f;
    float F[2][9];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      float low[3], high[3];
      row_gradient(h[c], side, low, high);
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        F[0][3 * c + i] = low[i] + (i == c ? 1.0f : 0.0f);
        F[1][3 * c + i] = high[i] + (i == c ? 1.0f : 0.0f);
      }
    }
    const float v0 = ty == 0 ? volume.x : volume.z, v1 = ty == 0 ? volume.y : volume.w;
    stress<LawOf, kViscous>(body, v0, damping, F[0]);
    stress<LawOf, kViscous>(body, v1, damping, F[1]);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const float low[3] = {F[0][3 * c], F[0][3 * c + 1], F[0][3 * c + 2]};
      const float high[3] = {F[1][3 * c], F[1][3 * c + 1], F[1][3 * c + 2]};
      add_row_stress(low, high, side, out[c]);
    }
  }
  if (!kSpecial || step.near == 0) return;
  add_contact(t, b, body, s, step, x, y, z, sz, volume, h, out);
}

/// Sums what the cells give to a node plane, in a fixed order, and puts it to the slots from `slot`
/// on.
__device__ __forceinline__ void write_plane(const CudaBlock& b, const float4* exchange, float scale,
                                            float4* force) {
  const int pitch = b.nx + 2, count = pitch * (b.ny + 2), columns = b.nx * b.ny;
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    const int y = i / pitch, x = i - y * pitch;
    float4 f = {0, 0, 0, 0};
#pragma unroll
    for (int dy = 0; dy < 3; ++dy) {
#pragma unroll
      for (int dx = 0; dx < 3; ++dx) {
        const int cx = x - dx, cy = y - dy;
        const bool there = cx >= 0 && cy >= 0 && cx < b.nx && cy < b.ny;
        const float4 g =
            there ? exchange[(3 * dy + dx) * columns + cy * b.nx + cx] : float4{0, 0, 0, 0};
        f.x += g.x;
        f.y += g.y;
        f.z += g.z;
      }
    }
    __stcg(force + i, float4{scale * f.x, scale * f.y, scale * f.z, 0});
  }
}

/// Adds the plane force of the neighbouring thread, which has the other half of the column's cells.
__device__ __forceinline__ void add_neighbour(PlaneForce& p) {
  constexpr unsigned kAll = 0xffffffffu;
  p.AA += __shfl_xor_sync(kAll, p.AA, 1);
  p.Ad += __shfl_xor_sync(kAll, p.Ad, 1);
  p.AB += __shfl_xor_sync(kAll, p.AB, 1);
  p.dA += __shfl_xor_sync(kAll, p.dA, 1);
  p.dd += __shfl_xor_sync(kAll, p.dd, 1);
  p.dB += __shfl_xor_sync(kAll, p.dB, 1);
  p.BA += __shfl_xor_sync(kAll, p.BA, 1);
  p.Bd += __shfl_xor_sync(kAll, p.Bd, 1);
}

/// Forces of a block. Two threads, neighbours in a warp, walk up each column of cells: one has the
/// lower, the other the upper halves of the cells, with what these give to the next two node planes
/// in registers. Contact and cells that are not full need kSpecial.
template <class LawOf, bool kViscous, bool kSpecial>
__device__ __forceinline__ void block_forces(const CudaTables& t, const CudaBlock& b,
                                             const CudaBody& body, const BlockShared& s,
                                             const BlockStep& step) {
  const int column = static_cast<int>(threadIdx.x) / 2, columns = b.nx * b.ny;
  const bool active = column < columns;
  const int y = column / b.nx, x = column - y * b.nx;
  const int plane = (b.nx + 2) * (b.ny + 2);
  const bool partial = kSpecial && b.partial != 0;
  PlaneForce next[3] = {}, after[3] = {};
#pragma unroll 1
  for (int z = 0; z < b.nz + 2; ++z) {
    const int sz = static_cast<int>(threadIdx.x) % 2;
    PlaneForce now[3];
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      now[c] = next[c];
      next[c] = after[c];
      after[c] = {};
    }
    if (active && z < b.nz) {
      const HalfWeights k(sz == 0 ? -1.0f : 1.0f);
      HalfPlane out[3];
      half_forces<LawOf, kViscous, kSpecial>(t, b, body, s, step, x, y, z, sz, k, out);
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        add_to_plane(out[c], k.below, k.slope_below, now[c]);
        add_to_plane(out[c], kAverageCenter, k.slope_center, next[c]);
        add_to_plane(out[c], k.above, k.slope_above, after[c]);
      }
      const float mu =
          partial && sz == 0 ? t.partial[b.first_lane / 8 + (z * b.ny + y) * b.nx + x] : 0.0f;
      if (kSpecial && mu != 0) {
        const float4* node = s.u + z * plane + y * (b.nx + 2) + x;
#pragma unroll
        for (int c = 0; c < 3; ++c) {
          const StabilisingForce f =
              stabilising_force(node, b.nx + 2, plane, c, kStabilisation * mu);
          add(f.plane[0], now[c]);
          add(f.plane[1], next[c]);
          add(f.plane[2], after[c]);
        }
      }
    }
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      add_neighbour(now[c]);
      if (kSpecial) now[c].BB += __shfl_xor_sync(0xffffffffu, now[c].BB, 1);
    }
    if (active) {
      float f[3][3][3];
#pragma unroll
      for (int c = 0; c < 3; ++c) node_forces<kSpecial>(now[c], f[c]);
#pragma unroll
      for (int k = 0; k < 9; ++k) {
        if ((k < 5) != (sz == 0)) continue;  // each of the two writes half of the sums
        s.exchange[k * columns + column] = {f[0][k / 3][k % 3], f[1][k / 3][k % 3],
                                            f[2][k / 3][k % 3], 0};
      }
    }
    __syncthreads();
    write_plane(b, s.exchange, -body.inv_cell_size, step.force + b.first_slot + z * plane);
    __syncthreads();
  }
}

}  // namespace tissue_sim
