// Which cells near colliders are pushed, and by whom. For .cu files.
//
// Few points are near a tool, and the slowest thread block decides how long a substep takes. So
// cells near colliders are no work of the block that they are in: a warp of any thread block pushes
// the points of one, once all nodes are in place.
#pragma once

#include "math/bspline.h"
#include "mpm/cuda/added_mass.h"
#include "mpm/cuda/tool_pushes.h"

namespace tissue_sim {

/// Displacement [m] and velocity [m/s] of a cell's 27 nodes, which a warp brings for all its lanes.
struct WarpNodes {
  float u[27][3], v[27][3], inv_mass[27];  ///< the last [1/kg]
};

/// Weights of a cell's nodes along each axis at the place where colliders touch a point.
struct PlaceWeights {
  float at[3], of[3][3];  ///< place in cells from the middle of the cell; [axis][node]
  bool is_stiff = false;  ///< what holds it off is: kStiffPlace

  __device__ __forceinline__ PlaceWeights(const CudaTables& t, int point, int s) {
#pragma unroll
    for (int a = 0; a < 3; ++a) at[a] = (s >> a & 1) != 0 ? 0.25f : -0.25f;
    if (point >= 0) {
      const float4 place = __ldg(t.outer + point);
      is_stiff = place.w == kStiffPlace;
      if (place.w != 0) at[0] = place.x, at[1] = place.y, at[2] = place.z;
    }
    weigh();
  }
  /// Makes the place one of its kPlaceParts parts in the surface's plane. Returns whether it has
  /// any: else it stays whole.
  __device__ __forceinline__ bool take_part(const CudaTables& t, int point, int part) {
    constexpr float kOff = 0.125f;  // of a point's cube, half a cell wide [cells]
    if (point < 0 || !is_stiff) return false;
    const float4 plane = __ldg(t.planes + point);
    const int axis = static_cast<int>(plane.w);
    if (axis < 0) return false;
    const float normal[3] = {plane.x, plane.y, plane.z};
    float along = 0;
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      if (a == axis) continue;
      const float off = (part >> (a == (axis + 1) % 3 ? 0 : 1) & 1) != 0 ? kOff : -kOff;
      at[a] += off;
      along += off * normal[a];
    }
#pragma unroll
    for (int a = 0; a < 3; ++a) at[a] -= a == axis ? along : 0.0f;
    weigh();
    return true;
  }
  __device__ __forceinline__ void weigh() {
#pragma unroll
    for (int a = 0; a < 3; ++a) {
#pragma unroll
      for (int i = 0; i < 3; ++i) of[a][i] = cell_weight(at[a], i);
    }
  }
  /// Sum of the sizes of the 27 weights: 1 but where the place lies outside of the cell.
  __device__ __forceinline__ float size() const {
    float product = 1;
#pragma unroll
    for (int a = 0; a < 3; ++a) product *= fabsf(of[a][0]) + fabsf(of[a][1]) + fabsf(of[a][2]);
    return product;
  }
};

/// Sum of w^2 / m over the nodes [1/kg].
__device__ __forceinline__ float mobility_at(const WarpNodes& nodes, const PlaceWeights& w) {
  float sum = 0;
#pragma unroll
  for (int k = 0; k < 27; ++k) {
    const float weight = w.of[0][k % 3] * w.of[1][k / 3 % 3] * w.of[2][k / 9];
    sum += weight * weight * nodes.inv_mass[k];
  }
  return sum;
}

/// One component of what nodes have there.
__device__ __forceinline__ float at_place(const float (&of)[27][3], int c, const PlaceWeights& w) {
  float sum = 0;
#pragma unroll
  for (int z = 0; z < 3; ++z) {
    float plane = 0;
#pragma unroll
    for (int y = 0; y < 3; ++y) {
      float row = 0;
#pragma unroll
      for (int x = 0; x < 3; ++x) row += w.of[0][x] * of[9 * z + 3 * y + x][c];
      plane += w.of[1][y] * row;
    }
    sum += w.of[2][z] * plane;
  }
  return sum;
}

/// What the colliders of one substep do to the nodes.
struct ToolPushes {
  const Collider* colliders;  ///< in shared memory
  unsigned long long* loads;  ///< per collider
  long long* force;           ///< per node, see NodePushes
  long long* inertia;         ///< the same
  float dt, kick, grown;  ///< as CudaFrame::step and ::grown; this is 0 but in the first substep
};

/// Adds what colliders push the points of a cell with to its nodes; `itself`: each where it is, and
/// not at the surface before it. The first eight lanes of the warp have its points, the first 27
/// its nodes; of each component of a point's place and velocity another lane works out the sum.
/// With kParts, each eight lanes have a part of the points' places instead, and work out all of it.
template <bool kParts>
__device__ __forceinline__ void push_cell(const CudaTables& t, const CudaNodes& state,
                                          const CudaNearCell& cell, bool itself,
                                          const ToolPushes& pushes, WarpNodes& nodes) {
  const int lane = static_cast<int>(threadIdx.x) % 32, k = min(lane, 26);
  const int s = lane % 8, component = min(lane / 8, 2);
  const int at = cell.lane + s * cell.step;
  const std::int32_t entry =
      __ldg(t.slot_node + cell.slot + k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3);
  const int p = __ldg(t.point + at), node = entry < 0 ? ~entry : entry;
  const float volume = __ldg(t.volume + at);
  const CudaBody& body = t.bodies[cell.body];
  PlaceWeights weights(t, itself ? -1 : p, s);
  const int part = kParts ? lane / 8 : 0;
  const bool has_parts = kParts && weights.take_part(t, p, part);
  const float4 u = __ldcg(state.u + node), v = __ldcg(state.v + node);
  Held held;
  PushedPoint point;
  point.index = lane < 8 || has_parts ? p : -1;
  if (point.index >= 0) {
    held.load(t, p, part);
    point.is_cut = t.bonds[p] != kAllBonds;
  }
  point.parts = has_parts ? kPlaceParts : 1;
  point.area = weights.is_stiff ? __ldg(t.area + p) / point.parts : 0;
  point.volume = volume;
  point.modulus = body.lambda + 2 * body.mu;
  point.density = body.density;
  point.cell_size = body.cell_size;
  __syncwarp();
  nodes.u[k][0] = u.x, nodes.u[k][1] = u.y, nodes.u[k][2] = u.z;
  nodes.v[k][0] = v.x, nodes.v[k][1] = v.y, nodes.v[k][2] = v.z;
  nodes.inv_mass[k] = v.w;
  __syncwarp();
  float x = 0, velocity = 0;
  if (!kParts) {
    x = at_place(nodes.u, component, weights);
    velocity = at_place(nodes.v, component, weights);
  }
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float moved =
        kParts ? at_place(nodes.u, a, weights) : __shfl_sync(0xffffffffu, x, s + 8 * a);
    point.x[a] = cell.middle[a] + weights.at[a] * body.cell_size + moved;
    point.v[a] =
        kParts ? at_place(nodes.v, a, weights) : __shfl_sync(0xffffffffu, velocity, s + 8 * a);
  }
  const bool held_before = (held.with[0] | held.with[1]) != 0;
  float push[3] = {0, 0, 0}, force[3] = {0, 0, 0};
  const auto resist = [&](int c, const float(&normal)[3], float along, float across, bool begins) {
    const unsigned places = __ballot_sync(0xffffffffu, across > 0);
    if (places == 0) return;
    InertialPlaces all;
    all.mask = places;
    all.inertia = kInertia * across * pushes.dt * pushes.dt * weights.size();
    all.taken = begins ? 1 : pushes.grown;
    all.along = along;
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const int i = a == 0 ? k % 3 : (a == 1 ? k / 3 % 3 : k / 9);
      all.at[a] = weights.at[a];
      all.normal[a] = normal[a];
      all.v[a] = nodes.v[k][a];
      all.x[a] = cell.middle[a] + (i - 1) * body.cell_size + nodes.u[k][a];
    }
    const int own = lane < 27 && v.w != 0 ? node : -1;
    const float3 taken = add_inertia(all, pushes.colliders + c, c, pushes.kick, own, pushes.inertia,
                                     pushes.force, pushes.loads);
    force[0] += taken.x, force[1] += taken.y, force[2] += taken.z;
  };
  push_by_near<kParts ? 32 : 8>(
      point, pushes.colliders, cell.near, t.held_by, pushes.dt, held, pushes.loads, push,
      [&] { return mobility_at(nodes, weights); }, resist);
  const bool holds = (held.with[0] | held.with[1]) != 0;
  if (point.index >= 0 && (holds || held_before)) held.store(t, p, part);
  unsigned left = __ballot_sync(0xffffffffu, holds);
  if (left == 0) return;
  for (; left != 0; left &= left - 1) {
    const int from = __ffs(static_cast<int>(left)) - 1;
    float w = 1;
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const float at = __shfl_sync(0xffffffffu, weights.at[a], from);
      w *= cell_weight(at, a == 0 ? k % 3 : (a == 1 ? k / 3 % 3 : k / 9));
    }
#pragma unroll
    for (int a = 0; a < 3; ++a) force[a] += w * __shfl_sync(0xffffffffu, push[a], from);
  }
  if (lane < 27) add_push(pushes.force, node, 1.0f, force);
}

/// Those of the colliders `near` a cell that are so thin that places are taken apart for them.
__device__ __forceinline__ std::uint32_t thin_ones(const Collider* colliders, std::uint32_t near,
                                                   float cell_size) {
  const int c = static_cast<int>(threadIdx.x) % 32;
  return __ballot_sync(0xffffffffu, (near >> c & 1) != 0 && colliders[c].kind != Collider::kJaw &&
                                        stiffer_across(colliders[c].radius, cell_size) > 1);
}
/// Those that are blades: their flats push points, where they have cut. At the surface before a
/// point they would push what they are about to cut, with springs that drag it along.
__device__ __forceinline__ std::uint32_t blades(const Collider* colliders, std::uint32_t near) {
  const int c = static_cast<int>(threadIdx.x) % 32;
  return __ballot_sync(0xffffffffu, (near >> c & 1) != 0 && colliders[c].kind == Collider::kBlade);
}

/// Pushes for these alone. Out of line, for fronts to keep their registers.
inline __device__ __noinline__ void push_cell_parts(const CudaTables t, const CudaNodes state,
                                                    const CudaNearCell* of, const ToolPushes pushes,
                                                    WarpNodes* nodes) {
  CudaNearCell cell = *of;
  cell.near = thin_ones(pushes.colliders, cell.near, t.bodies[cell.body].cell_size);
  if (cell.near != 0) push_cell<true>(t, state, cell, false, pushes, *nodes);
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
  /// Pushes the points of those that are close to a collider. With kThin, their places are taken
  /// apart for colliders that are thin.
  template <bool kThin>
  __device__ __forceinline__ void push(const CudaTables& t, const CudaNodes& state, float reach,
                                       const ToolPushes& pushes, WarpNodes& nodes) {
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
        const int from = __ffs(static_cast<int>(left)) - 1;
        CudaNearCell one = cell_of_lane(cell, from);
        const bool parts = kThin && t.place_parts > 1;
        if (parts) {
          one.near &= ~thin_ones(pushes.colliders, one.near, t.bodies[one.body].cell_size);
        }
        const std::uint32_t all = one.near, by_blades = blades(pushes.colliders, all);
#pragma unroll 1  // its code once
        for (const bool itself : {false, true}) {
          one.near = itself ? by_blades : all & ~by_blades;
          if (one.near != 0) push_cell<false>(t, state, one, itself, pushes, nodes);
        }
        if (parts) {
          push_cell_parts(t, state, cells + __shfl_sync(0xffffffffu, i - step, from), pushes,
                          &nodes);
        }
      }
    }
  }
};

}  // namespace tissue_sim
