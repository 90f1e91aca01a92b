// Contact of one point with the colliders near its block. For .cu files.
#pragma once

#include "cutting/bonds.h"
#include "mpm/cuda/block_nodes.h"

namespace tissue_sim {

/// Velocity of the point at sub-position s [m/s], from its 27 nodes of `v` (divided by the cell
/// size).
__device__ inline void point_velocity(const float4* v, int pitch, int plane, int s, float cell_size,
                                      float (&result)[3]) {
  result[0] = result[1] = result[2] = 0;
  for (int k = 0; k < 27; ++k) {
    const float4 at = v[k / 9 * plane + k / 3 % 3 * pitch + k % 3];
    const float w = cell_size * lattice_weight(s & 1, k % 3) *
                    lattice_weight(s >> 1 & 1, k / 3 % 3) * lattice_weight(s >> 2, k / 9);
    result[0] += w * at.x;
    result[1] += w * at.y;
    result[2] += w * at.z;
  }
}

/// Adds to the load of a collider, of this block in this substep, in shared memory.
__device__ inline void add_load(unsigned long long* load, double value) {
  atomicAdd(load, static_cast<unsigned long long>(__double2ll_rn(value / kLoadUnit)));
}

/// Whether a point within `radius` of `x` may lie in the collider.
__device__ __forceinline__ bool may_touch(const Collider& c, const float (&x)[3], float radius) {
  float p[3];
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) return p[2] < radius;
  const bool blade = c.kind == Collider::kBlade;
  const float side = radius + (blade ? 0.5f * c.thickness : c.radius);
  const float front = blade ? 0 : c.radius, back = blade ? c.width : c.radius;
  return p[2] < radius && p[2] > -c.length - radius && fabsf(p[1]) < side &&
         p[0] < front + radius && p[0] > -back - radius;
}

/// Force of the colliders `near` on the point `p` at `x` [N]; out of line, for few points touch
/// anything and the others shall keep their registers.
inline __device__ __noinline__ float3 contact_push(const CudaTables& t, const Collider* colliders,
                                                   std::uint32_t near, int p, float volume,
                                                   float3 place, const ContactSpring& unit,
                                                   const float4* v, int pitch, int plane, int s,
                                                   float cell_size, unsigned long long* loads) {
  const float x[3] = {place.x, place.y, place.z};
  float3 sum = {0, 0, 0};
  bool touches = false;
  for (std::uint32_t left = near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    const Collider& collider = colliders[c];
    const Gap g = gap(collider, x);
    if (!(g.distance < 0)) continue;
    if (collider.kind == Collider::kBlade && t.bonds[p] == kAllBonds) continue;
    float velocity[3], push[3];
    point_velocity(v, pitch, plane, s, cell_size, velocity);
    float* hold = t.hold + 3 * static_cast<std::size_t>(p);
    if (t.with[p] != c + 1) {
      t.with[p] = static_cast<std::uint8_t>(c + 1);
      to_local(collider, x, hold);
    }
    touches = true;
    contact_force(collider, g, {unit.stiffness * volume, unit.damping * volume}, x, velocity, hold,
                  push);
    sum.x += push[0];
    sum.y += push[1];
    sum.z += push[2];
    if (collider.tool < 0) continue;  // nobody asks what the ground carries
    double arm[3];
    for (int a = 0; a < 3; ++a) arm[a] = static_cast<double>(x[a]) - collider.position[a];
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      add_load(loads + 6 * c + a, -push[a]);
      add_load(loads + 6 * c + 3 + a, -(arm[b] * push[d] - arm[d] * push[b]));
    }
  }
  // A point that no longer touches anything forgets where it was held.
  if (!touches && t.with[p] != 0) t.with[p] = 0;
  return sum;
}

}  // namespace tissue_sim
