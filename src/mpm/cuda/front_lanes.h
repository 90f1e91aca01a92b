// A cell at the front of a cut, worked on by eight lanes of a warp, one for each of its points,
// with the CPU's template (mpm/blocks/front_stress.h). For .cu files.
#pragma once

#include "math/bspline.h"
#include "mpm/blocks/front_stress.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/add_push.h"
#include "mpm/cuda/front_tables.h"

namespace tissue_sim {

inline constexpr int kFrontLanes = 8;                 ///< of a warp for a cell
inline constexpr int kFrontCells = 32 / kFrontLanes;  ///< of a warp

/// Of three values, that of d = 0, 1 or 2, without a branch.
__device__ __forceinline__ float of_three(int d, float zero, float one, float two) {
  const float outer = d == 0 ? zero : two;
  return d == 1 ? one : outer;
}

/// Weights along one axis, and slopes times the cell size, of a cell's nodes at a point of side s:
/// lattice_weight() and lattice_slope(), without a branch.
struct SideWeights {
  float weight_0, weight_2, slope_0, slope_1, slope_2;

  __device__ __forceinline__ explicit SideWeights(int s)
      : weight_0(s == 0 ? lattice_weight(0, 0) : lattice_weight(1, 0)),
        weight_2(s == 0 ? lattice_weight(0, 2) : lattice_weight(1, 2)),
        slope_0(s == 0 ? lattice_slope(0, 0) : lattice_slope(1, 0)),
        slope_1(s == 0 ? lattice_slope(0, 1) : lattice_slope(1, 1)),
        slope_2(s == 0 ? lattice_slope(0, 2) : lattice_slope(1, 2)) {}
  __device__ __forceinline__ float weight(int d) const {
    return of_three(d, weight_0, lattice_weight(0, 1), weight_2);
  }
  __device__ __forceinline__ float slope(int d) const {
    return of_three(d, slope_0, slope_1, slope_2);
  }
};

/// What a node of a cell, of three along an axis, has in the number of a kind (0 A, 1 d, 2 B).
__device__ __forceinline__ float share_along(int kind, int d) {
  return of_three(kind, d == 1 ? kAverageCenter : kAverageSide, static_cast<float>(d - 1),
                  d == 1 ? -2.0f : 1.0f);
}
/// The same of node k of its 27 and the kinds x + 3 y + 9 z.
__device__ __forceinline__ float share_in(int kinds, int k) {
  return share_along(kinds % 3, k % 3) * share_along(kinds / 3 % 3, k / 3 % 3) *
         share_along(kinds / 9, k / 9);
}

/// What a lane has of something that the cell has 27 of at most: every eighth.
struct LaneShare {
  static constexpr int kEach = 4;
  float of[kEach][3] = {};

  __device__ __forceinline__ void set(int m, const float4& value) {
    of[m][0] = value.x, of[m][1] = value.y, of[m][2] = value.z;
  }
  /// Entry k of all, for each lane. `k` is best known to the compiler.
  __device__ __forceinline__ void get(unsigned mask, int k, float (&x)[3]) const {
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const int m = k / kFrontLanes;
      const float low = m == 0 ? of[0][c] : of[1][c], high = m == 2 ? of[2][c] : of[3][c];
      const float mine = m < 2 ? low : high;
      x[c] = __shfl_sync(mask, mine, k % kFrontLanes, kFrontLanes);
    }
  }
};

/// The eight points of a cell: mpm/blocks/front_stress.h. All that others write is read at once,
/// each lane reading its share.
struct LanePoints {
  using T = float;
  const CudaFront& front;
  const FrontCell& cell;
  long long* push;  ///< sums of forces: see NodePushes
  int count;        ///< cell.count
  float mu_here;
  int lane = static_cast<int>(threadIdx.x) % kFrontLanes;
  unsigned mask = ((1u << kFrontLanes) - 1) << (threadIdx.x % 32 - lane);
  SideWeights along[3] = {SideWeights(lane & 1), SideWeights(lane >> 1 & 1),
                          SideWeights(lane >> 2)};
  std::int32_t own_node[LaneShare::kEach], own_part[LaneShare::kEach];
  LaneShare of_nodes[2], of_parts[2];  ///< displacement, and velocity if it is viscous

  __device__ __forceinline__ LanePoints(const CudaFront& f, int i, long long* pushes)
      : front(f), cell(f.cells[i]), push(pushes), count(__ldg(&cell.count)) {
    mu_here = __ldg(cell.mu + lane);
    const FrontPart* parts = front.parts + __ldg(&cell.first);
#pragma unroll
    for (int m = 0; m < LaneShare::kEach; ++m) {
      own_node[m] = __ldg(cell.node + min(lane + kFrontLanes * m, 26));
      own_part[m] = front.first_node + __ldg(&parts[min(lane + kFrontLanes * m, count - 1)].node);
    }
  }
  template <bool kRate>
  __device__ __forceinline__ void bring(const float4* values) {
    float4 of_node[LaneShare::kEach], of_part[LaneShare::kEach];
#pragma unroll
    for (int m = 0; m < LaneShare::kEach; ++m) {
      of_node[m] = __ldcg(values + own_node[m]);
      of_part[m] = __ldcg(values + own_part[m]);
    }
#pragma unroll
    for (int m = 0; m < LaneShare::kEach; ++m) {
      of_nodes[kRate ? 1 : 0].set(m, of_node[m]);
      of_parts[kRate ? 1 : 0].set(m, of_part[m]);
    }
  }
  /// Once nodes and parted nodes are in place.
  __device__ __forceinline__ void bring(const CudaNodes& state) {
    bring<false>(state.u);
    if (__ldg(cell.viscosity) > 0) bring<true>(state.v);
  }
  /// Node of the lane's entry m.
  __device__ __forceinline__ std::int32_t node_of(int m) const {
    return __ldg(cell.node + lane + kFrontLanes * m);
  }
  __device__ __forceinline__ FrontPart part(int j) const {
    const FrontPart* from = front.parts + __ldg(&cell.first) + j;
    return {__ldg(&from->node), __ldg(&from->k), __ldg(&from->side), __ldg(&from->share),
            __ldg(&from->step)};
  }
  __device__ __forceinline__ float slope(int k, int axis) const {
    const int d[3] = {k % 3, k / 3 % 3, k / 9};
    float value = along[axis].slope(d[axis]);
#pragma unroll
    for (int a = 0; a < 3; ++a) value *= a == axis ? 1.0f : along[a].weight(d[a]);
    return value;
  }
  __device__ __forceinline__ float mu() const { return mu_here; }
  __device__ __forceinline__ float lambda() const { return __ldg(cell.lambda + lane); }
  __device__ __forceinline__ float keep(float x) const { return mu_here > 0 ? x : 0.0f; }
  __device__ __forceinline__ float sum(float x) const {
#pragma unroll
    for (const int step : {4, 1, 2}) x += __shfl_xor_sync(mask, x, step);
    return x;
  }
  template <bool kRate>
  __device__ __forceinline__ void gradient(float* G) const {
#pragma unroll
    for (int i = 0; i < 9; ++i) G[i] = 0;
#pragma unroll
    for (int k = 0; k < 27; ++k) {
      float value[3];
      of_nodes[kRate ? 1 : 0].get(mask, k, value);
      front::add_gradient(*this, value, k, G);
    }
#pragma unroll
    for (int i = 0; i < 9; ++i) G[i] *= cell.inverse_size;
  }
  template <bool kRate>
  __device__ __forceinline__ void parted(int j, float (&x)[3]) const {
    of_parts[kRate ? 1 : 0].get(mask, j, x);
  }
  __device__ __forceinline__ void pull(int j, int c, float force) const {
    if (lane == 0) add_push(push, front.first_node + part(j).node, c, force);
  }
};

/// Forces of the cell's stress on its nodes.
__device__ __forceinline__ void push_nodes(const LanePoints& p, const float (&stress)[9]) {
  const float by = -p.cell.inverse_size;
  float of_point[kFrontLanes][9];
#pragma unroll
  for (int point = 0; point < kFrontLanes; ++point) {
#pragma unroll
    for (int n = 0; n < 9; ++n) {
      of_point[point][n] = __shfl_sync(p.mask, by * stress[n], point, kFrontLanes);
    }
  }
#pragma unroll 1
  for (int m = 0; m < LaneShare::kEach; ++m) {
    const int k = min(p.lane + kFrontLanes * m, 26), d[3] = {k % 3, k / 3 % 3, k / 9};
    float weight[3][2], slope[3][2];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
#pragma unroll
      for (int s = 0; s < 2; ++s) {
        weight[a][s] = SideWeights(s).weight(d[a]);
        slope[a][s] = SideWeights(s).slope(d[a]);
      }
    }
    float force[3] = {};
#pragma unroll
    for (int point = 0; point < kFrontLanes; ++point) {
      const int s[3] = {point & 1, point >> 1 & 1, point >> 2};
      const float by_axis[3] = {slope[0][s[0]] * weight[1][s[1]] * weight[2][s[2]],
                                weight[0][s[0]] * slope[1][s[1]] * weight[2][s[2]],
                                weight[0][s[0]] * weight[1][s[1]] * slope[2][s[2]]};
#pragma unroll
      for (int c = 0; c < 3; ++c) {
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
          force[c] += of_point[point][3 * c + axis] * by_axis[axis];
        }
      }
    }
    if (p.lane + kFrontLanes * m < 27) add_push(p.push, p.node_of(m), 1.0f, force);
  }
}

/// What resists motion of the cell's parts without strain (mpm/blocks/stabilisation.h), each lane
/// with every eighth of the 27 numbers: adds its pull on them. Returns the energy [J].
template <bool kPulls>
__device__ __forceinline__ double stabilise(const LanePoints& p) {
  constexpr int kInHand = 4;
  const FrontCell& cell = p.cell;
  const auto by = [&](const FrontPart& part) {
    return sqrtf(part.share) * part.side * cell.inverse_size;
  };
  float number[kInHand][3] = {}, twice_energy = 0;
  for (int j = 0; j < p.count; ++j) {
    const FrontPart part = p.part(j);
    float d[3];
    p.parted<false>(j, d);
#pragma unroll
    for (int m = 0; m < kInHand; ++m) {
      const float share = by(part) * share_in(p.lane + kFrontLanes * m, part.k);
#pragma unroll
      for (int c = 0; c < 3; ++c) number[m][c] += share * d[c];
    }
  }
#pragma unroll
  for (int m = 0; m < kInHand; ++m) {
    const int kinds = p.lane + kFrontLanes * m;
    const float stiffness =
        kinds < 27 ? cell.stabilised * stabilisation::weight2(kinds % 3, kinds / 3 % 3, kinds / 9)
                   : 0.0f;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      twice_energy += stiffness * number[m][c] * number[m][c];
      number[m][c] *= stiffness;
    }
  }
  for (int j = 0; kPulls && j < p.count; ++j) {
    const FrontPart part = p.part(j);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      float force = 0;
#pragma unroll
      for (int m = 0; m < kInHand; ++m) {
        force += share_in(p.lane + kFrontLanes * m, part.k) * number[m][c];
      }
      p.pull(j, c, -by(part) * p.sum(force));
    }
  }
  return 0.5 * p.sum(twice_energy);
}

}  // namespace tissue_sim
