// A contact of tissue with tissue in the hands of some lanes of a warp, which share the 27 nodes
// around either place. For .cu files.
#pragma once

#include "math/bspline.h"
#include "mpm/contact/narrow_phase.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

inline constexpr int kContactLanes = 16;  ///< that work together where nothing else is said

/// kLanes of a warp that work together. All groups of a warp call what asks their lanes at once;
/// or with kApart each for itself, which costs as many instructions again.
template <int kLanes, bool kApart>
struct LaneGroup {
  static constexpr int kNodes = (27 + kLanes - 1) / kLanes;  ///< that each has in hand

  int lane = static_cast<int>(threadIdx.x) % kLanes;
  unsigned mask = kApart ? ((1u << kLanes) - 1) << (threadIdx.x % 32 - lane) : 0xffffffffu;

  /// Which of 27 nodes the lane has as its j-th; from 27 on none.
  __device__ __forceinline__ int node(int j) const { return lane + kLanes * j; }
  /// Whether it is so for any of those that call.
  __device__ __forceinline__ bool any(bool so) const {
    return kApart ? so : __any_sync(mask, so) != 0;
  }
  /// Sum over the lanes, the same bits in each.
  __device__ __forceinline__ float sum(float value) const {
#pragma unroll
    for (int step = kLanes / 2; step > 0; step /= 2) {
      value += __shfl_xor_sync(mask, value, step);
    }
    return value;
  }
};

/// Node of a slot's entry in CudaTables::slot_node.
__device__ __forceinline__ std::int32_t node_of_entry(std::int32_t entry) {
  return entry < 0 ? ~entry : entry;
}

/// Node k of the 27 around a facet's cell, x fastest.
__device__ __forceinline__ std::int32_t node_around(const CudaLooks& s, const CudaFacet& f, int k) {
  return node_of_entry(__ldg(s.slot_node + f.slot + k / 9 * f.plane + k / 3 % 3 * f.pitch + k % 3));
}

/// The nodes around a place, as the lanes of a group have them.
template <class Group>
struct LanePlace {
  static constexpr int kLaneNodes = Group::kNodes;
  std::int32_t node[kLaneNodes];
  float4 u[kLaneNodes];      // displacement [m]
  float weight[kLaneNodes];  // 0 where there is no node

  __device__ __forceinline__ void set_weights(const Group& lanes, const float (&place)[3]) {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) {
      const int k = lanes.node(j);
      weight[j] = k >= 27 ? 0.0f
                          : cell_weight(place[0], k % 3) * cell_weight(place[1], k / 3 % 3) *
                                cell_weight(place[2], k / 9);
    }
  }
  __device__ __forceinline__ void find_nodes(const Group& lanes, const CudaLooks& s, int facet) {
    const CudaFacet& f = s.facets[facet];
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) node[j] = node_around(s, f, min(lanes.node(j), 26));
  }
  __device__ __forceinline__ void load_nodes(const Group& lanes, const std::int32_t* from) {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) node[j] = from[min(lanes.node(j), 26)];
  }
  __device__ __forceinline__ void store_nodes(const Group& lanes, std::int32_t* to) const {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) {
      if (lanes.node(j) < 27) to[lanes.node(j)] = node[j];
    }
  }
  __device__ __forceinline__ void load_weights(const Group& lanes, const float* from) {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) {
      weight[j] = lanes.node(j) < 27 ? from[lanes.node(j)] : 0.0f;
    }
  }
  __device__ __forceinline__ void store_weights(const Group& lanes, float* to) const {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) {
      if (lanes.node(j) < 27) to[lanes.node(j)] = weight[j];
    }
  }
  __device__ __forceinline__ void bring(const float4* field) {
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) u[j] = __ldcg(field + node[j]);
  }
  __device__ __forceinline__ void displacement(const Group& lanes, float (&value)[3]) const {
    value[0] = value[1] = value[2] = 0;
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) {
      value[0] += weight[j] * u[j].x;
      value[1] += weight[j] * u[j].y;
      value[2] += weight[j] * u[j].z;
    }
    for (float& v : value) v = lanes.sum(v);
  }
  /// Sum of w^2 / m [1/kg].
  __device__ __forceinline__ float mobility(const Group& lanes, const float4* v) const {
    float sum = 0;
#pragma unroll
    for (int j = 0; j < kLaneNodes; ++j) sum += weight[j] * weight[j] * __ldcg(v + node[j]).w;
    return lanes.sum(sum);
  }
};

/// Node field around a facet's cell: mpm/surface/facet_in_world.h.
struct SlotField {
  const std::int32_t* slot_node;  // from the cell's lowest slot on
  int pitch, plane;
  const float4* of;

  __device__ __forceinline__ void row(int y, int z, float (&u)[3][3]) const {
    const std::int32_t* n = slot_node + z * plane + y * pitch;
#pragma unroll
    for (int x = 0; x < 3; ++x) {
      const float4 value = __ldcg(of + node_of_entry(__ldg(n + x)));
      u[0][x] = value.x, u[1][x] = value.y, u[2][x] = value.z;
    }
  }
};

/// Reference place of the middle of a facet's cell [m].
__device__ __forceinline__ void middle_of(const CudaLooks& s, const CudaFacet& f,
                                          double (&place)[3]) {
  const double* origin = s.lattices[f.body].origin;
  for (int a = 0; a < 3; ++a) place[a] = origin[a] + s.cell_size * f.cell[a];
}

/// How a facet stands.
__device__ __forceinline__ FacetMotion motion_of(const CudaLooks& s, const CudaNodes& state,
                                                 const CudaFacet& f) {
  double place[3];
  middle_of(s, f, place);
  for (int a = 0; a < 3; ++a) place[a] += s.cell_size * f.facet.center[a];
  const SlotField u{s.slot_node + f.slot, f.pitch, f.plane, state.u};
  return facet_motion(f.facet, place, s.cell_size, u,
                      SlotField{u.slot_node, f.pitch, f.plane, state.v});
}

/// The two places of a contact, as a group of lanes reaches them: see push_face().
template <int kLanes, bool kApart>
struct LanePlaces {
  using Group = LaneGroup<kLanes, kApart>;
  Group lanes;
  CudaNodes state;
  LanePlace<Group> own_place, other_place;

  __device__ __forceinline__ LanePlaces(const CudaNodes& nodes, const CudaLooks& looks)
      : state(nodes) {}

  /// Takes a contact in hand whose nodes are known; the place held is still to be set.
  __device__ __forceinline__ void take(const CudaContactNodes& known) {
    own_place.load_nodes(lanes, known.own);
    other_place.load_nodes(lanes, known.other);
    own_place.load_weights(lanes, known.weight);
  }
  /// Brings displacements, once they are what they shall be.
  __device__ __forceinline__ void bring() {
    own_place.bring(state.u);
    other_place.bring(state.u);
  }
  __device__ __forceinline__ bool any(bool so) const { return lanes.any(so); }
  __device__ __forceinline__ void own(float (&value)[3]) const {
    own_place.displacement(lanes, value);
  }
  __device__ __forceinline__ void held(float (&value)[3]) const {
    other_place.displacement(lanes, value);
  }
  __device__ __forceinline__ void hold(const float (&place)[3]) {
    other_place.set_weights(lanes, place);
  }
  __device__ __forceinline__ float own_mobility() const {
    return own_place.mobility(lanes, state.v);
  }
  __device__ __forceinline__ float held_mobility() const {
    return other_place.mobility(lanes, state.v);
  }
};

/// Facets and nodes as a look at a contact reaches them: mpm/contact/narrow_phase.h.
struct LaneFaces : LanePlaces<kContactLanes, true> {
  const CudaLooks& s;
  int index = 0;  // facet

  __device__ __forceinline__ LaneFaces(const CudaLooks& looks, const CudaNodes& nodes)
      : LanePlaces(nodes, looks), s(looks) {}

  /// Takes a contact in hand whose nodes are to be found.
  __device__ __forceinline__ void take(const FaceSpring& c) {
    own_place.find_nodes(lanes, s, c.facet);
    other_place.find_nodes(lanes, s, c.other < 0 ? c.facet : c.other);
    own_place.set_weights(lanes, facet(c.facet).center);
    hold(c.hold);
  }
  __device__ __forceinline__ void hold_in(int f) {
    other_place.find_nodes(lanes, s, f);
    other_place.bring(state.u);
  }
  __device__ __forceinline__ const Facet& facet(int f) const { return s.facets[f].facet; }
  __device__ __forceinline__ const FacetMotion& motion(int f) const { return s.motion[f]; }
  __device__ __forceinline__ int body(int f) const { return s.facets[f].body; }
  __device__ __forceinline__ void middle(int f, double (&place)[3]) const {
    middle_of(s, s.facets[f], place);
  }
  __device__ __forceinline__ double modulus(int f) const { return s.facets[f].modulus; }
  __device__ __forceinline__ float friction(int f) const { return s.facets[f].friction; }
  __device__ __forceinline__ double cell_size() const { return s.cell_size; }
  __device__ __forceinline__ float per_cell() const { return s.per_cell; }
  __device__ __forceinline__ int near(int n) const { return s.near[n]; }
  /// Those near, each lane every sixteenth, some whose places are under way at once.
  template <class Visit>
  __device__ __forceinline__ void for_each_near(const Visit& visit) const {
    constexpr int kTogether = 4;
    const int first = s.first_near[index], end = first + s.near_count[index];
    for (int n = first + lanes.lane; n < end; n += kTogether * kContactLanes) {
      int other[kTogether];
      float x[kTogether][3];
#pragma unroll
      for (int i = 0; i < kTogether; ++i) other[i] = s.near[min(n + i * kContactLanes, end - 1)];
#pragma unroll
      for (int i = 0; i < kTogether; ++i) {
#pragma unroll
        for (int a = 0; a < 3; ++a) x[i][a] = s.motion[other[i]].x[a];
      }
#pragma unroll
      for (int i = 0; i < kTogether; ++i) {
        if (n + i * kContactLanes < end) visit(n + i * kContactLanes, other[i], x[i]);
      }
    }
  }
  __device__ __forceinline__ float largest(float x) const {
#pragma unroll
    for (int step = kContactLanes / 2; step > 0; step /= 2) {
      x = fmaxf(x, __shfl_xor_sync(lanes.mask, x, step));
    }
    return x;
  }
  /// The best of all lanes.
  __device__ __forceinline__ NearFacet nearest(NearFacet best) const {
#pragma unroll
    for (int step = kContactLanes / 2; step > 0; step /= 2) {
      const float beyond = __shfl_xor_sync(lanes.mask, best.beyond, step);
      const int at = __shfl_xor_sync(lanes.mask, best.at, step);
      if (beyond < best.beyond || (beyond == best.beyond && at < best.at)) best = {beyond, at};
    }
    return best;
  }
};

}  // namespace tissue_sim
