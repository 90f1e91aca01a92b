// A contact of tissue with tissue in the hands of a warp: one lane for each of the 27 nodes around
// either place. For .cu files.
#pragma once

#include "contact/look_at_face.h"
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
  const float4* v;           // CudaNodes::v
  int own_node, other_node;  // of lanes without one, another's
  float4 own_u, other_u;     // displacement there [m]
  float own_weight, weight;  // 0 where there is none

  static __device__ __forceinline__ void sum(const float4& u, float w, float (&value)[3]) {
    value[0] = warp_sum(w * u.x);
    value[1] = warp_sum(w * u.y);
    value[2] = warp_sum(w * u.z);
  }
  __device__ __forceinline__ float weight_at(const float (&place)[3]) const {
    return k >= 27 ? 0.0f
                   : cell_weight(place[0], k % 3) * cell_weight(place[1], k / 3 % 3) *
                         cell_weight(place[2], k / 9);
  }
  __device__ __forceinline__ float mobility(int node, float w) const {
    return warp_sum(w * w * __ldcg(v + node).w);
  }
  __device__ __forceinline__ void own(float (&value)[3]) const { sum(own_u, own_weight, value); }
  __device__ __forceinline__ void held(float (&value)[3]) const { sum(other_u, weight, value); }
  __device__ __forceinline__ void hold(const float (&place)[3]) { weight = weight_at(place); }
  __device__ __forceinline__ float own_mobility() const { return mobility(own_node, own_weight); }
  __device__ __forceinline__ float held_mobility() const { return mobility(other_node, weight); }
};

/// Node field around a facet's cell: contact/facet_in_world.h.
struct SlotField {
  const std::int32_t* slot_node;  // from the cell's lowest slot on
  int pitch, plane;
  const float4* of;

  __device__ __forceinline__ void row(int y, int z, float (&u)[3][3]) const {
    const std::int32_t* n = slot_node + z * plane + y * pitch;
#pragma unroll
    for (int x = 0; x < 3; ++x) {
      const std::int32_t entry = __ldg(n + x);
      const float4 value = __ldcg(of + (entry < 0 ? ~entry : entry));
      u[0][x] = value.x, u[1][x] = value.y, u[2][x] = value.z;
    }
  }
};

/// Reference place of the middle of a facet's cell [m].
__device__ __forceinline__ void middle_of(const CudaLooks& s, const CudaFacet& f,
                                          double (&place)[3]) {
  const CudaLattice& lattice = s.lattices[f.body];
  for (int a = 0; a < 3; ++a) place[a] = lattice.origin[a] + lattice.cell_size * f.cell[a];
}

/// Brings the motion of a facet up to date.
__device__ __forceinline__ void move_facet(const CudaLooks& s, const CudaNodes& state, int index) {
  const CudaFacet& f = s.facets[index];
  const double cell_size = s.lattices[f.body].cell_size;
  double place[3];
  middle_of(s, f, place);
  for (int a = 0; a < 3; ++a) place[a] += cell_size * f.facet.center[a];
  const SlotField u{s.slot_node + f.slot, f.pitch, f.plane, state.u};
  s.motion[index] =
      facet_motion(f.facet, place, cell_size, u, SlotField{u.slot_node, f.pitch, f.plane, state.v});
}

/// Facets and nodes as a look at the contact `index` reaches them: contact/look_at_face.h.
struct WarpFaces : WarpPlaces {
  const CudaLooks& s;
  const float4* u;
  int index;

  __device__ __forceinline__ WarpFaces(const CudaLooks& looks, const CudaNodes& state,
                                       const FaceSpring& c)
      : s(looks), u(state.u), index(c.facet) {
    k = static_cast<int>(threadIdx.x) % 32;
    v = state.v;
    own_node = node_of(index);
    own_u = __ldcg(u + own_node);
    own_weight = weight_at(facet(index).center);
    hold_in(c.other < 0 ? index : c.other);
    hold(c.hold);
  }
  __device__ __forceinline__ int node_of(int f) const {
    const CudaFacet& at = s.facets[f];
    const int n = min(k, 26);
    const std::int32_t entry =
        __ldg(s.slot_node + at.slot + n / 9 * at.plane + n / 3 % 3 * at.pitch + n % 3);
    return entry < 0 ? ~entry : entry;
  }
  __device__ __forceinline__ const Facet& facet(int f) const { return s.facets[f].facet; }
  __device__ __forceinline__ const FacetMotion& motion(int f) const { return s.motion[f]; }
  __device__ __forceinline__ double cell_size(int f) const {
    return s.lattices[s.facets[f].body].cell_size;
  }
  __device__ __forceinline__ int body(int f) const { return s.facets[f].body; }
  __device__ __forceinline__ void middle(int f, double (&place)[3]) const {
    middle_of(s, s.facets[f], place);
  }
  __device__ __forceinline__ double modulus(int f) const { return s.facets[f].modulus; }
  __device__ __forceinline__ float friction(int f) const { return s.facets[f].friction; }
  __device__ __forceinline__ double cell_size() const { return s.cell_size; }
  __device__ __forceinline__ int first_near() const { return s.first_near[index]; }
  __device__ __forceinline__ int end_near() const {
    return s.first_near[index] + s.near_count[index];
  }
  __device__ __forceinline__ int near(int n) const { return s.near[n]; }
  __device__ __forceinline__ int lane() const { return k; }
  __device__ __forceinline__ static int lanes() { return 32; }
  __device__ __forceinline__ static NearFacet nearest(NearFacet best) {
#pragma unroll
    for (int step = 16; step > 0; step /= 2) {
      const float beyond = __shfl_xor_sync(0xffffffffu, best.beyond, step);
      const int at = __shfl_xor_sync(0xffffffffu, best.at, step);
      if (beyond < best.beyond || (beyond == best.beyond && at < best.at)) best = {beyond, at};
    }
    return best;
  }
  __device__ __forceinline__ void hold_in(int f) {
    other_node = node_of(f);
    other_u = __ldcg(u + other_node);
  }
};

}  // namespace tissue_sim
