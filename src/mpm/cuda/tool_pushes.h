// What colliders push the nodes with. For .cu files.
//
// Few points are near a tool, and the slowest thread block decides how long a substep takes. So
// cells near colliders are no work of the block that they are in: a warp of any thread block pushes
// the points of one, once all nodes are in place.
#pragma once

#include "cutting/bonds.h"
#include "math/bspline.h"
#include "mpm/cuda/add_push.h"

namespace tissue_sim {

/// Whether a point within `radius` of `x` may lie in the collider; with a radius of 0, whether x
/// does, up to rounding.
__device__ __forceinline__ bool may_touch(const Collider& c, const float* x, float radius) {
  float p[3];
  to_local(c, x, p);
  if (c.kind == Collider::kPlane) return p[2] < radius;
  if (c.kind != Collider::kBlade) {
    const float z = p[2] - fminf(fmaxf(p[2], -c.length), -c.radius), reach = c.radius + radius;
    return p[0] * p[0] + p[1] * p[1] + z * z < reach * reach &&
           (c.kind == Collider::kCapsule || p[0] < radius);
  }
  return p[2] < radius && p[2] > -c.length - radius && fabsf(p[1]) < radius + 0.5f * c.thickness &&
         p[0] < radius && p[0] > -c.width - radius;
}

/// Adds forces and moments of a warp's first eight lanes to a load, as integers, whose sum does not
/// depend on the order.
__device__ __forceinline__ void add_load(unsigned long long* load, const double (&value)[6]) {
  long long sum[6];
#pragma unroll
  for (int i = 0; i < 6; ++i) sum[i] = __double2ll_rn(value[i] * (1 / kLoadUnit));
#pragma unroll
  for (int step = 4; step > 0; step /= 2) {
#pragma unroll
    for (int i = 0; i < 6; ++i) sum[i] += __shfl_xor_sync(0xffffffffu, sum[i], step);
  }
  const int lane = static_cast<int>(threadIdx.x) % 32;
  long long mine = sum[0];
#pragma unroll
  for (int i = 1; i < 6; ++i) mine = lane == i ? sum[i] : mine;
  if (lane < 6) atomicAdd(load + lane, static_cast<unsigned long long>(mine));
}

/// What a point remembers of its contacts: CudaTables::with and hold.
struct Held {
  int with[2] = {0, 0};
  float place[2][3] = {};

  __device__ __forceinline__ void load(const CudaTables& t, int p) {
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      with[slot] = __ldcg(t.with + p * t.held_by + slot);
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        place[slot][a] = __ldcg(t.hold + 3 * (static_cast<std::size_t>(p) * t.held_by + slot) + a);
      }
    }
  }
  __device__ __forceinline__ void store(const CudaTables& t, int p) const {
#pragma unroll
    for (int slot = 0; slot < 2; ++slot) {
      if (slot >= t.held_by) return;
      __stcg(t.with + p * t.held_by + slot, static_cast<std::uint8_t>(with[slot]));
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        __stcg(t.hold + 3 * (static_cast<std::size_t>(p) * t.held_by + slot) + a, place[slot][a]);
      }
    }
  }
};

/// A point that colliders may push.
struct PushedPoint {
  int index;            ///< -1 where there is none
  bool is_cut = false;  ///< it has lost a bond
  float x[3], v[3];     ///< [m], [m/s]
  ContactSpring spring;
  __device__ __forceinline__ bool touches(const Collider& c) const {
    return index >= 0 && (is_cut || c.kind != Collider::kBlade) && may_touch(c, x, 0);
  }
};

/// Force of the colliders on the point [N], whose load goes to `loads`. All lanes of a warp take
/// part; `near` are the colliders that any of their points may lie in.
__device__ __forceinline__ void push_point(const PushedPoint& point, const Collider* colliders,
                                           std::uint32_t near, int held_by, Held& held,
                                           unsigned long long* loads, float (&sum)[3]) {
  bool holds[2] = {false, false};
  for (std::uint32_t left = near; left != 0; left &= left - 1) {
    const int c = __ffs(static_cast<int>(left)) - 1;
    const Collider& collider = colliders[c];
    const bool touches = point.touches(collider);
    if (__ballot_sync(0xffffffffu, touches) == 0) continue;
    float push[3] = {0, 0, 0};
    bool pushes = false;
    if (touches) {
      const Gap g = gap(collider, point.x);
      const bool second =
          held_by == 2 && (held.with[1] == c + 1 || (held.with[0] != 0 && held.with[0] != c + 1));
      pushes = g.distance < 0;
      if (pushes) {
        float place[3];
#pragma unroll
        for (int a = 0; a < 3; ++a) place[a] = second ? held.place[1][a] : held.place[0][a];
        if ((second ? held.with[1] : held.with[0]) != c + 1) to_local(collider, point.x, place);
        contact_force(collider, g, point.spring, point.x, point.v, place, push);
        (second ? held.with[1] : held.with[0]) = c + 1;
        (second ? holds[1] : holds[0]) = true;
#pragma unroll
        for (int a = 0; a < 3; ++a) (second ? held.place[1][a] : held.place[0][a]) = place[a];
#pragma unroll
        for (int a = 0; a < 3; ++a) sum[a] += push[a];
      }
    }
    if (collider.tool < 0) continue;  // nobody asks what the ground carries
    double arm[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) arm[a] = static_cast<double>(point.x[a]) - collider.position[a];
    double load[6];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      load[a] = -push[a];
      load[3 + a] = -(arm[b] * push[d] - arm[d] * push[b]);
    }
    add_load(loads + kLoadSums * c, load);
    if (collider.kind == Collider::kJaw) {
      const unsigned pushed = __ballot_sync(0xffffffffu, pushes);
      if (threadIdx.x % 32 == 0) atomicAdd(loads + kLoadSums * c + 6, 1ull * __popc(pushed));
    }
  }
#pragma unroll
  for (int slot = 0; slot < 2; ++slot) {
    if (!holds[slot]) held.with[slot] = 0;
  }
}

/// Brings the colliders of a substep to shared memory: the first word of each thread is under way
/// while other things are done.
struct ColliderCopy {
  const int* source;
  int words, i, word;
  __device__ __forceinline__ ColliderCopy(const CudaFrame& f, int substep)
      : source(reinterpret_cast<const int*>(f.colliders + substep * f.collider_count)),
        words(static_cast<int>(sizeof(Collider) / sizeof(int)) * f.collider_count),
        i(static_cast<int>(threadIdx.x)),
        word(i < words ? __ldg(source + i) : 0) {}
  __device__ __forceinline__ void finish(Collider* to) const {
    if (i >= words) return;
    int* out = reinterpret_cast<int*>(to);
    out[i] = word;
    for (int j = i + static_cast<int>(blockDim.x); j < words; j += static_cast<int>(blockDim.x)) {
      out[j] = __ldg(source + j);
    }
  }
};

/// Displacement [m] and velocity [m/s] of a cell's 27 nodes, which a warp brings for all its lanes.
struct CellNodes {
  float u[27][3], v[27][3];
};

/// One component of what nodes have at the point at sub-position s.
__device__ __forceinline__ float at_point(const float (&of)[27][3], int c, int s) {
  float sum = 0;
#pragma unroll
  for (int z = 0; z < 3; ++z) {
    float plane = 0;
#pragma unroll
    for (int y = 0; y < 3; ++y) {
      float row = 0;
#pragma unroll
      for (int x = 0; x < 3; ++x) row += lattice_weight(s & 1, x) * of[9 * z + 3 * y + x][c];
      plane += lattice_weight(s >> 1 & 1, y) * row;
    }
    sum += lattice_weight(s >> 2, z) * plane;
  }
  return sum;
}

/// What the colliders of one substep do to the nodes.
struct ToolPushes {
  const Collider* colliders;  ///< in shared memory
  unsigned long long* loads;  ///< per collider
  long long* force;           ///< per node, see NodePushes
};

/// Adds what colliders push the points of a cell with to its nodes. The first eight lanes of the
/// warp have its points, the first 27 its nodes; of each component of a point's place and velocity
/// another lane works out the sum.
__device__ __forceinline__ void push_cell(const CudaTables& t, const CudaNodes& state,
                                          const CudaNearCell& cell, const ToolPushes& pushes,
                                          CellNodes& nodes) {
  const int lane = static_cast<int>(threadIdx.x) % 32, k = min(lane, 26);
  const int s = lane % 8, component = min(lane / 8, 2);
  const int at = cell.lane + s * cell.step;
  const std::int32_t entry =
      __ldg(t.slot_node + cell.slot + k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3);
  const int p = __ldg(t.point + at), node = entry < 0 ? ~entry : entry;
  const float volume = __ldg(t.volume + at);
  const CudaBody& body = t.bodies[cell.body];
  const float quarter = 0.25f * body.cell_size;
  const float4 u = __ldcg(state.u + node), v = __ldcg(state.v + node);
  Held held;
  PushedPoint point;
  point.index = lane < 8 ? p : -1;
  if (point.index >= 0) {
    held.load(t, p);
    point.is_cut = t.bonds[p] != kAllBonds;
  }
  point.spring = {body.spring.stiffness * volume, body.spring.damping * volume};
  __syncwarp();
  nodes.u[k][0] = u.x, nodes.u[k][1] = u.y, nodes.u[k][2] = u.z;
  nodes.v[k][0] = v.x, nodes.v[k][1] = v.y, nodes.v[k][2] = v.z;
  __syncwarp();
  const float x = at_point(nodes.u, component, s), velocity = at_point(nodes.v, component, s);
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float moved = __shfl_sync(0xffffffffu, x, s + 8 * a);
    point.x[a] = cell.middle[a] + ((s >> a & 1) != 0 ? quarter : -quarter) + moved;
    point.v[a] = __shfl_sync(0xffffffffu, velocity, s + 8 * a);
  }
  const bool held_before = (held.with[0] | held.with[1]) != 0;
  float push[3] = {0, 0, 0};
  push_point(point, pushes.colliders, cell.near, t.held_by, held, pushes.loads, push);
  const bool holds = (held.with[0] | held.with[1]) != 0;
  if (point.index >= 0 && (holds || held_before)) held.store(t, p);
  unsigned left = __ballot_sync(0xffffffffu, holds);
  if (left == 0) return;
  float force[3] = {0, 0, 0};
  for (; left != 0; left &= left - 1) {
    const int from = __ffs(static_cast<int>(left)) - 1;
    const float w = lattice_weight(from & 1, k % 3) * lattice_weight(from >> 1 & 1, k / 3 % 3) *
                    lattice_weight(from >> 2, k / 9);
#pragma unroll
    for (int a = 0; a < 3; ++a) force[a] += w * __shfl_sync(0xffffffffu, push[a], from);
  }
  if (lane < 27) add_push(pushes.force + 3 * static_cast<std::size_t>(node), 1.0f, force);
}

/// What lane `from` of a warp has of a cell.
__device__ __forceinline__ CudaNearCell cell_of_lane(const CudaNearCell& mine, int from) {
  const auto get = [from](auto value) { return __shfl_sync(0xffffffffu, value, from); };
  CudaNearCell cell;
#pragma unroll
  for (int a = 0; a < 3; ++a) cell.middle[a] = get(mine.middle[a]);
  cell.near = get(mine.near);
  cell.slot = get(mine.slot);
  cell.pitch = get(mine.pitch);
  cell.plane = get(mine.plane);
  cell.lane = get(mine.lane);
  cell.step = get(mine.step);
  cell.body = get(mine.body);
  return cell;
}

/// The cells near colliders that the lanes of a warp look at, each the next of its own under way
/// while other things are done. Warps `warp` of `warps` take part; cells side by side are of
/// different warps.
struct NearSearch {
  const CudaNearCell* cells;
  int count, i, step;
  CudaNearCell next;

  __device__ __forceinline__ void load() {
    if (i >= count) return;
    int4* to = reinterpret_cast<int4*>(&next);
#pragma unroll
    for (int k = 0; k < 3; ++k) to[k] = __ldg(reinterpret_cast<const int4*>(cells + i) + k);
  }
  __device__ __forceinline__ NearSearch(const CudaFrame& f, int warp, int warps)
      : cells(f.near_cells),
        count(cells == nullptr ? 0 : __ldg(f.near_count)),
        i(static_cast<int>(threadIdx.x) % 32 * warps + warp),
        step(32 * warps) {
    load();
  }
  /// Pushes the points of those that are close to a collider.
  __device__ __forceinline__ void push(const CudaTables& t, const CudaNodes& state, float reach,
                                       const ToolPushes& pushes, CellNodes& nodes) {
    while (__any_sync(0xffffffffu, i < count)) {
      const CudaNearCell cell = next;
      const std::uint32_t near = i < count ? cell.near : 0;
      bool close = false;
      float4 u;
      if (near != 0) u = __ldcg(state.u + cell.node);
      i += step;
      load();
      if (near != 0) {
        const float x[3] = {cell.middle[0] + u.x, cell.middle[1] + u.y, cell.middle[2] + u.z};
        for (std::uint32_t left = near; left != 0 && !close; left &= left - 1) {
          close = may_touch(pushes.colliders[__ffs(static_cast<int>(left)) - 1], x, reach);
        }
      }
      for (unsigned left = __ballot_sync(0xffffffffu, close); left != 0; left &= left - 1) {
        push_cell(t, state, cell_of_lane(cell, __ffs(static_cast<int>(left)) - 1), pushes, nodes);
      }
    }
  }
};

}  // namespace tissue_sim
