// What lets the stiff springs between tools and the true surface keep the substeps of tissue, on a
// GPU. For .cu files.
//
// As on a CPU (mpm/contact/contact_inertia.h) an added mass b stands beside each spring across the
// surface, along the normal n; but here nothing of it stays from a substep to the next. Each place
// that touches adds b |w| n n^T to what its nodes have (B) for this substep, as integers, whose sum
// does not depend on the order. Where contact begins, what the added mass takes of the nodes' speed
// towards the collider goes to their forces. All who move a node on do it by
//   v' = keep v + (m + B)^-1 m dv, dv what it would be without added masses;
// who owns it adds what did not happen of dv to the load on the collider.
#pragma once

#include "mpm/cuda/tables.h"
#include "mpm/cuda/tool_pushes.h"

namespace tissue_sim {

/// Adds what pushes a node [N] to component c of its sum: see NodePushes.
__device__ __forceinline__ void add_push(long long* sums, int node, int c, float push) {
  const long long units = __float2ll_rn(push * static_cast<float>(1 / kLoadUnit));
  long long* sum = sums + kPushStride * static_cast<std::size_t>(node) + c;
  atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(units));
}

/// Adds a share of a force [N] to all of it.
__device__ __forceinline__ void add_push(long long* sums, int node, float weight,
                                         const float* force) {
#pragma unroll
  for (int c = 0; c < 3; ++c) add_push(sums, node, c, weight * force[c]);
}

/// What a warp has at hand of places of a cell that touch a collider: places are of lanes of
/// `mask`, nodes of the first 27.
struct InertialPlaces {
  unsigned mask;
  float at[3];       ///< place in cells from the middle of the cell
  float normal[3];   ///< of the collider there
  float inertia;     ///< b times the sum of the weights' sizes [kg]
  float along;       ///< velocity of the collider there along the normal [m/s]
  float taken;       ///< share of the inertia that takes its share of motion in this substep
  float x[3], v[3];  ///< of the node [m], [m/s]
};

/// Adds the inertia to the lane's `node`, -1 where it has none that moves. Returns the force that
/// takes from the node what new added masses take [N], whose opposite goes to the collider's load.
/// All lanes take part. Out of line, for what is beside to keep its registers.
inline __device__ __noinline__ float3 add_inertia(const InertialPlaces all,
                                                  const Collider* collider, int index, float kick,
                                                  int node, long long* inertia, long long* force,
                                                  unsigned long long* loads) {
  const int k = min(static_cast<int>(threadIdx.x) % 32, 26);
  float B[6] = {}, taken[3] = {};
  bool takes = false;
  for (unsigned left = all.mask; left != 0; left &= left - 1) {
    const auto get = [from = __ffs(static_cast<int>(left)) - 1](float value) {
      return __shfl_sync(0xffffffffu, value, from);
    };
    float scale = get(all.inertia), n[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      scale *= fabsf(cell_weight(get(all.at[a]), a == 0 ? k % 3 : (a == 1 ? k / 3 % 3 : k / 9)));
      n[a] = get(all.normal[a]);
    }
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      B[a] += scale * n[a] * n[a];
      B[3 + a] += scale * n[a] * n[(a + 1) % 3];
    }
    const float share = get(all.taken), of_collider = get(all.along);
    if (share == 0) continue;
    takes = true;
    const float nearing = n[0] * all.v[0] + n[1] * all.v[1] + n[2] * all.v[2] - of_collider;
#pragma unroll
    for (int a = 0; a < 3; ++a) taken[a] -= share * scale * nearing * n[a] / kick;
  }
  if (node >= 0) {
#pragma unroll
    for (int i = 0; i < 6; ++i) {
      const long long units = __float2ll_rn(B[i] * static_cast<float>(1 / kInertiaUnit));
      atomicAdd(reinterpret_cast<unsigned long long*>(inertia) +
                    kInertiaStride * static_cast<std::size_t>(node) + i,
                static_cast<unsigned long long>(units));
    }
    atomicMax(force + kPushStride * static_cast<std::size_t>(node) + 3,
              static_cast<long long>(index + 1));
  } else {
    taken[0] = taken[1] = taken[2] = 0;
  }
  if (takes && collider->tool >= 0) {
    double arm[3], load[6];
#pragma unroll
    for (int a = 0; a < 3; ++a) arm[a] = static_cast<double>(all.x[a]) - collider->position[a];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      load[a] = -taken[a];
      load[3 + a] = -(arm[b] * taken[d] - arm[d] * taken[b]);
    }
    add_load<32>(loads + kLoadSums * index, load);
  }
  return {taken[0], taken[1], taken[2]};
}

/// What added masses take from a node's change of velocity in a substep [m/s]: `after` it would be
/// without them. Out of line and in so many words, for all who move the node to get the same bits.
inline __device__ __noinline__ float3 resisted(const long long* inertia, float inv_mass, float keep,
                                               float3 before, float3 after) {
  float B[6];
#pragma unroll
  for (int i = 0; i < 6; i += 2) {
    const longlong2 two = __ldcg(reinterpret_cast<const longlong2*>(inertia + i));
    const float unit = inv_mass * static_cast<float>(kInertiaUnit);
    B[i] = __ll2float_rn(two.x) * unit;
    B[i + 1] = __ll2float_rn(two.y) * unit;
  }
  // (1 + B / m) x = change, as L D L^T, whose pivots are not below 1.
  const float change[3] = {after.x - keep * before.x, after.y - keep * before.y,
                           after.z - keep * before.z};
  const float d0 = 1 + B[0], l10 = B[3] / d0, l20 = B[5] / d0;
  const float d1 = fmaxf(1.0f, 1 + B[1] - l10 * B[3]), e = B[4] - l20 * B[3], l21 = e / d1;
  const float d2 = fmaxf(1.0f, 1 + B[2] - l20 * B[5] - l21 * e);
  const float y1 = change[1] - l10 * change[0], y2 = change[2] - l20 * change[0] - l21 * y1;
  const float z = y2 / d2, y = y1 / d1 - l21 * z, x = change[0] / d0 - l10 * y - l20 * z;
  return {change[0] - x, change[1] - y, change[2] - z};
}

/// Where the loads of a substep's added masses go.
struct InertialLoads {
  const CudaBlock* blocks;  ///< of the bundle
  int block_count;
  const CudaBody* bodies;
  const Collider* colliders;  ///< of the substep
  unsigned long long* loads;  ///< per collider
};

/// Adds what a node's added masses bore in a substep, `force` [N], to the load on collider `index`.
/// The node has this slot and was moved by `u` before [m].
inline __device__ __noinline__ void add_resisted(const InertialLoads to, int index, int slot,
                                                 float3 u, float3 force) {
  const Collider* c = to.colliders + index;
  if (__ldg(&c->tool) < 0) return;
  int i = 0;
  while (i + 1 < to.block_count && to.blocks[i + 1].first_slot <= slot) ++i;
  const CudaBlock& b = to.blocks[i];
  const int local = slot - b.first_slot, pitch = b.nx + 2, plane = pitch * (b.ny + 2);
  const float h = to.bodies[b.body].cell_size;
  const int at[3] = {local % plane % pitch, local % plane / pitch, local / plane};
  const float moved[3] = {u.x, u.y, u.z};
  const double f[3] = {force.x, force.y, force.z};
  double arm[3];
  unsigned long long* load = to.loads + kLoadSums * index;
  const auto add = [&](int k, double value) {
    atomicAdd(load + k, static_cast<unsigned long long>(__double2ll_rn(value * (1 / kLoadUnit))));
  };
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    arm[a] = static_cast<double>(b.origin[a]) + static_cast<double>(h) * at[a] + moved[a] -
             __ldg(&c->position[a]);
  }
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int n = (a + 1) % 3, m = (a + 2) % 3;
    add(a, f[a]);
    add(3 + a, arm[n] * f[m] - arm[m] * f[n]);
  }
}

}  // namespace tissue_sim
