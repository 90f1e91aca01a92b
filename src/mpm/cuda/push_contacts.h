// Contacts of tissue with tissue within a substep: one warp for each, one lane for each of the 27
// nodes on either side. For .cu files.
#pragma once

#include "math/bspline.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Sum over the lanes of a warp, the same bits in each.
__device__ __forceinline__ float warp_sum(float value) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) value += __shfl_xor_sync(0xffffffffu, value, step);
  return value;
}

/// The places of a contact: see push_face(). Each lane knows one node of either cell.
struct WarpPlaces {
  int k;                     // which, from 27 on none
  float4 own_u, other_u;     // displacement there [m]
  float own_weight, weight;  // 0 where there is none
  float other_inv_mass;      // [1/kg]

  static __device__ __forceinline__ void sum(const float4& u, float w, float (&value)[3]) {
    value[0] = warp_sum(w * u.x);
    value[1] = warp_sum(w * u.y);
    value[2] = warp_sum(w * u.z);
  }
  __device__ __forceinline__ void own(float (&value)[3]) const { sum(own_u, own_weight, value); }
  __device__ __forceinline__ void held(float (&value)[3]) const { sum(other_u, weight, value); }
  __device__ __forceinline__ void hold(const float (&place)[3]) {
    weight = k >= 27 ? 0.0f
                     : cell_weight(place[0], k % 3) * cell_weight(place[1], k / 3 % 3) *
                           cell_weight(place[2], k / 9);
  }
  __device__ __forceinline__ float held_mobility() const {
    return warp_sum(weight * weight * other_inv_mass);
  }
};

/// Adds a force [N] to the sum of a node.
__device__ __forceinline__ void add_push(long long* sum, float weight, const float* force) {
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    const long long push = __float2ll_rn(weight * force[c] * static_cast<float>(1 / kLoadUnit));
    atomicAdd(reinterpret_cast<unsigned long long*>(sum) + c,
              static_cast<unsigned long long>(push));
  }
}

/// Works out all contacts and adds their forces to `force`, of the nodes; out of line, for the
/// blocks to keep their registers. Contacts that were just looked at are at rest, to the last bit.
inline __device__ __noinline__ void push_contacts(const CudaFaces faces, const float4* u, float dt,
                                                  bool looked, long long* force) {
  const int lane = static_cast<int>(threadIdx.x) % 32, warp = static_cast<int>(threadIdx.x) / 32;
  const int step = static_cast<int>(gridDim.x * blockDim.x) / 32, k = min(lane, 26);
  // Warps of different thread blocks first, so that all multiprocessors have their share.
  for (int i = warp * static_cast<int>(gridDim.x) + static_cast<int>(blockIdx.x); i < faces.count;
       i += step) {
    const CudaContactNodes& nodes = faces.nodes[i];
    const int own = __ldg(nodes.own + k), other = __ldg(nodes.other + k);
    WarpPlaces places;
    places.k = lane;
    places.own_weight = lane < 27 ? __ldg(nodes.weight + k) : 0.0f;
    places.own_u = __ldcg(u + own);
    places.other_u = __ldcg(u + other);
    places.other_inv_mass = __ldg(nodes.other_inv_mass + k);
    FaceSpring spring = faces.springs[i];
    places.hold(spring.hold);
    if (looked) {
      float own_value[3], held_value[3];
      places.own(own_value);
      places.held(held_value);
      spring.measure_apart(own_value, held_value);
    }
    push_face(spring, dt, places);
    __syncwarp();
    if (lane == 0) faces.springs[i] = spring;
    if (!spring.touching) continue;
    if (lane >= 27) continue;
    add_push(force + 3 * static_cast<std::size_t>(own), places.own_weight, spring.force);
    add_push(force + 3 * static_cast<std::size_t>(other), -places.weight, spring.force);
  }
}

}  // namespace tissue_sim
