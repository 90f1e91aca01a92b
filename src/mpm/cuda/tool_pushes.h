// What colliders push a point with, and what that does to them. For .cu files.
#pragma once

#include "contact/push_tool.h"
#include "mpm/cuda/grid_barrier.h"
#include "mpm/cuda/tables.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {

/// Whether a point within `radius` of `x` may lie in the collider; with a radius of 0, whether x
/// does, up to rounding.
__device__ __forceinline__ bool may_touch(const Collider& c, const float* x, float radius) {
  float p[3];
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) return p[2] < radius;
  if (c.kind >= Collider::kPunch) {
    float n[3];
    return rounded_distance(c, p, n) < radius;
  }
  if (c.kind != Collider::kBlade) {
    const float z = p[2] - fminf(fmaxf(p[2], -c.length), -c.radius), reach = c.radius + radius;
    return p[0] * p[0] + p[1] * p[1] + z * z < reach * reach &&
           (c.kind == Collider::kCapsule || p[0] < radius);
  }
  return p[2] < radius && p[2] > -c.length - radius && fabsf(p[1]) < radius + 0.5f * c.thickness &&
         p[0] < radius && p[0] > -c.width - radius;
}

/// Adds forces and moments of a warp's first lanes to a load, as integers, whose sum does not
/// depend on the order.
template <int kLanes>
__device__ __forceinline__ void add_load(unsigned long long* load, const double (&value)[6]) {
  long long sum[6];
#pragma unroll
  for (int i = 0; i < 6; ++i) sum[i] = __double2ll_rn(value[i] * (1 / kLoadUnit));
#pragma unroll
  for (int step = kLanes / 2; step > 0; step /= 2) {
#pragma unroll
    for (int i = 0; i < 6; ++i) sum[i] += __shfl_xor_sync(0xffffffffu, sum[i], step);
  }
  const int lane = static_cast<int>(threadIdx.x) % 32;
  long long mine = sum[0];
#pragma unroll
  for (int i = 1; i < 6; ++i) mine = lane == i ? sum[i] : mine;
  if (lane < 6) atomicAdd(load + lane, static_cast<unsigned long long>(mine));
}

/// What a point remembers of its contacts: CudaTables::with and hold, whose last figure has
/// ToolMemory::doubled in its lowest bits.
struct Held {
  int with[2] = {0, 0};
  float4 place[2] = {};

  static constexpr unsigned kDoubled = 7;
  static __device__ __forceinline__ ToolMemory memory(const float4& of) {
    const unsigned bits = __float_as_uint(of.w);
    return {{of.x, of.y, of.z},
            __uint_as_float(bits & ~kDoubled),
            static_cast<std::uint8_t>(bits & kDoubled)};
  }
  static __device__ __forceinline__ float4 entry(const ToolMemory& m) {
    return {m.hold[0], m.hold[1], m.hold[2],
            __uint_as_float((__float_as_uint(m.begun) & ~kDoubled) | m.doubled)};
  }

  static __device__ __forceinline__ std::size_t entry(const CudaTables& t, int p, int part) {
    return (static_cast<std::size_t>(p) * t.place_parts + part) * t.held_by;
  }
  __device__ __forceinline__ void load(const CudaTables& t, int p, int part) {
    const std::size_t first = entry(t, p, part);
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      with[slot] = __ldcg(t.with + first + slot);
      place[slot] = __ldcg(t.hold + first + slot);
    }
  }
  __device__ __forceinline__ void store(const CudaTables& t, int p, int part) const {
    const std::size_t first = entry(t, p, part);
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      __stcg(t.with + first + slot, static_cast<std::uint8_t>(with[slot]));
      __stcg(t.hold + first + slot, place[slot]);
    }
  }
};

/// How deep contact of a stiff spring begins, of how deep it is, where the spring is so much
/// stiffer for a thin tool: it pushes as hard then as the soft one would, so that a tool which
/// comes deep within a substep is held off as well.
__device__ __forceinline__ float begun_deep(float stiffer) { return 1 - 1 / (kAcross * stiffer); }

/// A point that colliders may push.
struct PushedPoint {
  int index;                          ///< -1 where there is none
  bool is_cut = false;                ///< it has lost a bond
  float x[3], v[3];                   ///< [m], [m/s]
  float area, parts;                  ///< PushedPlace's
  float volume;                       ///< [m^3]
  float modulus, density, cell_size;  ///< PushedTissue's
  __device__ __forceinline__ bool touches(const Collider& c) const {
    return index >= 0 && (is_cut || c.kind != Collider::kBlade) && may_touch(c, x, 0);
  }
};

/// Force of the colliders on the point [N], whose load goes to `loads`. All lanes of a warp take
/// part; `near` are the colliders that any of their points may lie in. Where any touches, all lanes
/// call resist(collider, its normal there, its velocity along that, ToolPush::across of the lane's
/// point, whether that begins). Jaws have soft springs: they close until what touches them
/// presses back, and of stiff ones too little touches. The first kLanes lanes have points, or parts
/// of their places, of which the first eight are counted. mobility() is the sum of w^2 / m over the
/// nodes of the lane's place [1/kg].
template <int kLanes, class Mobility, class Resist>
__device__ __forceinline__ void push_by_near(const PushedPoint& point, const Collider* colliders,
                                             std::uint32_t near, int held_by, float dt, Held& held,
                                             unsigned long long* loads, float (&sum)[3],
                                             const Mobility& mobility, const Resist& resist) {
  bool holds[2] = {false, false};
  for (std::uint32_t left = near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    const Collider& collider = colliders[c];
    const bool touches = point.touches(collider);
    if (__ballot_sync(0xffffffffu, touches) == 0) continue;
    ToolPush push = {};
    float normal[3] = {0, 0, 0}, distance = 0, along = 0;
    bool pushes = false, begins = false, is_inside = false;
    if (touches) {
      const Gap g = gap(collider, point.x);
      distance = g.distance;
      is_inside = distance < -collider.inside && collider.inside > 0 && threadIdx.x % 32 < 8;
      const bool second =
          held_by == 2 && (held.with[1] == c + 1 || (held.with[0] != 0 && held.with[0] != c + 1));
      pushes = g.distance < 0;
      if (pushes) {
        const float4 was = second ? held.place[1] : held.place[0];
        ToolMemory memory = Held::memory(was);
        begins = (second ? held.with[1] : held.with[0]) != c + 1;
        if (begins) {
          memory = {};
          to_local(collider, point.x, memory.hold);
        }
        if (point.area > 0 && collider.kind != Collider::kJaw) {
          const PushedTissue tissue =
              pushed_tissue(point.modulus, point.density, point.cell_size, collider.radius, dt);
          if (begins) memory.begun = begun_deep(tissue.stiffer) * -g.distance;
          push = push_tool(
              tissue, {point.x, point.v, point.area, point.parts}, collider, g, !begins, dt,
              [&](float per_mass) { return per_mass * mobility(); }, memory);
        } else {
          const ContactSpring soft =
              contact_spring(point.modulus, point.density, 0.5f * point.cell_size, point.volume);
          push_point(soft, point.x, point.v, collider, g, memory, push.force);
        }
        (second ? held.with[1] : held.with[0]) = c + 1;
        (second ? holds[1] : holds[0]) = true;
        (second ? held.place[1] : held.place[0]) = Held::entry(memory);
        float of_collider[3];
        velocity_at(collider, point.x, of_collider);
#pragma unroll
        for (int a = 0; a < 3; ++a) {
          sum[a] += push.force[a];
          normal[a] = g.normal[a];
          along += of_collider[a] * normal[a];
        }
      }
    }
    resist(c, normal, along, push.across, begins);
    if (collider.tool < 0) continue;  // nobody asks what the ground carries
    if (is_inside) {                  // seldom
      atomicAdd(loads + kLoadSums * c + 7, 1ull);
      atomicMax(loads + kLoadSums * c + 8,
                static_cast<unsigned long long>(-distance * (1 / kInsideUnit)));
    }
    double arm[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) arm[a] = static_cast<double>(point.x[a]) - collider.position[a];
    double load[6];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      load[a] = -push.force[a];
      load[3 + a] = -(arm[b] * push.force[d] - arm[d] * push.force[b]);
    }
    add_load<kLanes>(loads + kLoadSums * c, load);
    if (collider.kind == Collider::kJaw) {
      const unsigned pushed = __ballot_sync(0xffffffffu, pushes);
      if (threadIdx.x % 32 == 0) atomicAdd(loads + kLoadSums * c + 6, 1ull * __popc(pushed));
    }
  }
#pragma unroll
  for (int slot = 0; slot < 2; ++slot) {
    const bool of_others = held.with[slot] != 0 && (near >> (held.with[slot] - 1) & 1u) == 0;
    if (!holds[slot] && !of_others) held.with[slot] = 0;
  }
}

/// Brings the colliders of a substep to shared memory: the first word of each thread is under way
/// while other things are done.
struct ColliderCopy {
  const int* source;
  int words, threads, i, word;
  __device__ __forceinline__ ColliderCopy(const CudaFrame& f, int substep, const Pushers& team)
      : source(reinterpret_cast<const int*>(f.colliders + substep * f.collider_count)),
        words(static_cast<int>(sizeof(Collider) / sizeof(int)) * f.collider_count),
        threads(team.size()),
        i(team.me()),
        word(i < words ? __ldg(source + i) : 0) {}
  __device__ __forceinline__ void finish(Collider* to) const {
    if (i >= words) return;
    int* out = reinterpret_cast<int*>(to);
    out[i] = word;
    for (int j = i + threads; j < words; j += threads) out[j] = __ldg(source + j);
  }
};

}  // namespace tissue_sim
