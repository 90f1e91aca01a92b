// A cell at the front of a cut, worked on by a warp. For .cu files.
//
// Of the stresses that make up its energy (mpm/blocks/front_stress.h), four are worked out at a
// time: eight lanes, one for each point of the cell, have one of them. Of nodes, parts and numbers
// of stabilisation each lane has one.
#pragma once

#include "math/bspline.h"
#include "mpm/blocks/front_stress.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/add_push.h"
#include "mpm/cuda/front_tables.h"

namespace tissue_sim {

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

/// All lanes of the warp call everything together.
struct FrontWarp {
  using T = float;
  static constexpr int kPoints = 8, kGroups = 4;
  static constexpr unsigned kAll = 0xffffffffu;

  const CudaFront& front;
  const FrontCell& cell;
  int lane = static_cast<int>(threadIdx.x) % 32;
  int point = lane % kPoints, group = lane / kPoints;
  int count;       ///< of parts
  unsigned steps;  ///< bit j where there is a stress with the parts up to j
  float inverse_size, mu_here, lambda_here;
  bool viscous;
  SideWeights along[3] = {SideWeights(lane & 1), SideWeights(lane >> 1 & 1),
                          SideWeights(lane >> 2 & 1)};
  std::int32_t own_node;  ///< of number min(lane, 26) of the cell's
  FrontPart own;          ///< of number min(lane, count - 1) of the cell's
  float u[3], v[3];       ///< of the node
  float d[3], rate[3];    ///< of the part

  __device__ __forceinline__ FrontWarp(const CudaFront& f, int i) : front(f), cell(f.cells[i]) {
    count = __ldg(&cell.count);
    const FrontPart* part = front.parts + __ldg(&cell.first) + min(lane, count - 1);
    own = {__ldg(&part->node), __ldg(&part->k), __ldg(&part->side), __ldg(&part->share),
           __ldg(&part->step)};
    own_node = __ldg(cell.node + min(lane, 26));
    inverse_size = __ldg(&cell.inverse_size);
    mu_here = __ldg(cell.mu + point);
    lambda_here = __ldg(cell.lambda + point);
    viscous = __ldg(cell.viscosity) > 0 && __ldg(cell.viscosity + 1) > 0;  // both or none
    steps = __ballot_sync(kAll, lane < count && own.step > 0);
  }
  /// Once nodes and parted nodes are in place.
  __device__ __forceinline__ void bring(const CudaNodes& state) {
    const int parted = front.first_node + own.node;
    const float4 at = __ldcg(state.u + own_node), apart = __ldcg(state.u + parted);
    float4 speed = {0, 0, 0, 0}, speed_apart = speed;
    if (viscous) {
      speed = __ldcg(state.v + own_node);
      speed_apart = __ldcg(state.v + parted);
    }
    u[0] = at.x, u[1] = at.y, u[2] = at.z;
    v[0] = speed.x, v[1] = speed.y, v[2] = speed.z;
    d[0] = apart.x, d[1] = apart.y, d[2] = apart.z;
    rate[0] = speed_apart.x, rate[1] = speed_apart.y, rate[2] = speed_apart.z;
  }

  // What front_stress.h asks of the points; each group has those of its stress.
  __device__ __forceinline__ float slope(int k, int axis) const {
    const int of[3] = {k % 3, k / 3 % 3, k / 9};
    float value = along[axis].slope(of[axis]);
#pragma unroll
    for (int a = 0; a < 3; ++a) value *= a == axis ? 1.0f : along[a].weight(of[a]);
    return value;
  }
  __device__ __forceinline__ float mu() const { return mu_here; }
  __device__ __forceinline__ float lambda() const { return lambda_here; }
  __device__ __forceinline__ float keep(float x) const { return mu_here > 0 ? x : 0.0f; }
  __device__ __forceinline__ float sum(float x) const {
#pragma unroll
    for (const int step : {4, 1, 2}) x += __shfl_xor_sync(kAll, x, step);
    return x;
  }

  template <class Value>
  __device__ __forceinline__ static Value of_lane(Value x, int which) {
    return __shfl_sync(kAll, x, which);
  }

  /// Gradient of displacement or velocity, [9], with no node parted. Three groups have a plane of
  /// nodes each.
  template <bool kRate>
  __device__ __forceinline__ void gradient(float (&G)[9]) const {
    const int z = min(group, 2);
    const float weight = group < 3 ? along[2].weight(z) : 0.0f,
                slope = group < 3 ? along[2].slope(z) : 0.0f;
#pragma unroll
    for (int i = 0; i < 9; ++i) G[i] = 0;
#pragma unroll
    for (int k = 0; k < 9; ++k) {
      const float x = along[0].weight(k % 3), y = along[1].weight(k / 3);
      const float by[3] = {along[0].slope(k % 3) * y * weight, x * along[1].slope(k / 3) * weight,
                           x * y * slope};
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        const float value = of_lane(kRate ? v[c] : u[c], 9 * z + k);
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) G[3 * c + axis] += value * by[axis];
      }
    }
#pragma unroll
    for (int i = 0; i < 9; ++i) {
      G[i] += __shfl_xor_sync(kAll, G[i], 8);
      G[i] += __shfl_xor_sync(kAll, G[i], 16);
      G[i] *= inverse_size;
    }
  }

  /// Which stress a group has: none of the cell's where its weight is 0.
  struct Mixed {
    int number;    ///< 0 for that with no node parted
    int last;      ///< the last part that is parted in it, -1 for none
    float weight;  ///< of its energy in the cell's
  };
  __device__ __forceinline__ int mixed_count() const { return 1 + __popc(steps); }
  __device__ __forceinline__ Mixed mixed(int pass) const {
    Mixed m;
    m.number = kGroups * pass + group;
    unsigned left = steps;
    for (int i = 1; i < m.number; ++i) left &= left - 1;
    m.last = m.number == 0 || left == 0 ? -1 : __ffs(static_cast<int>(left)) - 1;
    const float share = of_lane(own.share, 0), step = of_lane(own.step, max(m.last, 0));
    m.weight = m.number == 0 ? -share : m.last < 0 ? 0.0f : step;
    return m;
  }
  /// Adds to gradients what parts up to `last` have more.
  __device__ __forceinline__ void add_parts(int last, float (&G)[9], float (&G_rate)[9]) const {
#pragma unroll 1
    for (int j = 0; j < count; ++j) {
      const int k = of_lane(own.k, j);
      const float side = of_lane(own.side, j), by = j <= last ? inverse_size * side : 0.0f;
      float value[3];
#pragma unroll
      for (int c = 0; c < 3; ++c) value[c] = by * of_lane(d[c], j);
      front::add_gradient(*this, value, k, G);
      if (!viscous) continue;
#pragma unroll
      for (int c = 0; c < 3; ++c) value[c] = by * of_lane(rate[c], j);
      front::add_gradient(*this, value, k, G_rate);
    }
  }

  /// Adds to the sums of forces (NodePushes) those of the cell's stress.
  template <class LawOf>
  __device__ __forceinline__ void push(long long* sums) const {
    float whole[9], whole_rate[9] = {}, stress[9] = {};  // the last: of all that are later
    gradient<false>(whole);
    if (viscous) gradient<true>(whole_rate);
#pragma unroll 1
    for (int pass = (mixed_count() - 1) / kGroups; pass >= 0; --pass) {
      const Mixed m = mixed(pass);
      float G[9], G_rate[9], P[9];
#pragma unroll
      for (int i = 0; i < 9; ++i) G[i] = whole[i], G_rate[i] = whole_rate[i];
      add_parts(m.last, G, G_rate);
      const float viscosity = __ldg(cell.viscosity + (m.number == 0 ? 0 : 1));
      front::stress<LawOf>(*this, G, G_rate, viscous ? viscosity : 0.0f, P);
#pragma unroll
      for (int i = 0; i < 9; ++i) {  // with those of the groups behind, and of later passes
        float x = m.weight == 0 ? 0.0f : m.weight * P[i];
        float behind = __shfl_down_sync(kAll, x, kPoints);
        x += group < 3 ? behind : 0.0f;
        behind = __shfl_down_sync(kAll, x, 2 * kPoints);
        x += group < 2 ? behind : 0.0f;
        P[i] = x + stress[i];
      }
      pull_parts(pass, P, sums);
#pragma unroll
      for (int i = 0; i < 9; ++i) stress[i] = of_lane(P[i], point);
    }
    push_nodes(stress, sums);
  }

  /// Energy of its points, above the block's [J].
  template <class LawOf>
  __device__ __forceinline__ double energy() const {
    float whole[9], unused[9] = {};
    gradient<false>(whole);
    double sum = 0;
#pragma unroll 1
    for (int pass = 0; kGroups * pass < mixed_count(); ++pass) {
      const Mixed m = mixed(pass);
      float G[9], F[1][9], of_points;
#pragma unroll
      for (int i = 0; i < 9; ++i) G[i] = whole[i];
      add_parts(m.last, G, unused);
      front::deformation(*this, G, F[0]);
      LawOf::template energies<1>(F, &mu_here, &lambda_here, &of_points);
      sum += m.weight == 0 ? 0.0 : static_cast<double>(m.weight) * of_points;
    }
    return all(sum);
  }

  /// What resists motion of the cell's parts without strain (mpm/blocks/stabilisation.h): with
  /// kPulls adds its pull on them. Returns the energy [J].
  template <bool kPulls>
  __device__ __forceinline__ double stabilise(long long* sums) const {
    const int kind[3] = {lane % 3, lane / 3 % 3, min(lane / 9, 2)};
    const float by = lane < count ? sqrtf(own.share) * own.side * inverse_size : 0.0f;
    float number[3] = {};
#pragma unroll 1
    for (int j = 0; j < count; ++j) {
      const int k = of_lane(own.k, j);
      const float share = of_lane(by, j) * share_along(kind[0], k % 3) *
                          share_along(kind[1], k / 3 % 3) * share_along(kind[2], k / 9);
#pragma unroll
      for (int c = 0; c < 3; ++c) number[c] += share * of_lane(d[c], j);
    }
    const float stiffness =
        lane < 27 ? cell.stabilised * stabilisation::weight2(kind[0], kind[1], kind[2]) : 0.0f;
    float twice_energy = 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      twice_energy += stiffness * number[c] * number[c];
      number[c] *= stiffness;
    }
    if (!kPulls) return 0.5 * all(twice_energy);
    const int k[3] = {own.k % 3, own.k / 3 % 3, own.k / 9};
    float force[3] = {};
#pragma unroll
    for (int i = 0; i < 27; ++i) {
      const float share =
          share_along(i % 3, k[0]) * share_along(i / 3 % 3, k[1]) * share_along(i / 9, k[2]);
#pragma unroll
      for (int c = 0; c < 3; ++c) force[c] += share * of_lane(number[c], i);
    }
    if (lane < count) add_push(sums, front.first_node + own.node, -by, force);
    return 0;
  }

 private:
  /// Sum of all lanes'.
  template <class Value>
  __device__ __forceinline__ static double all(Value of_lane) {
    double x = of_lane;
#pragma unroll
    for (int step = 1; step < 32; step *= 2) x += __shfl_xor_sync(kAll, x, step);
    return x;
  }

  /// Forces on the parts that begin to be parted in one of the pass's stresses, of which each group
  /// has the sum from its own on. A group works on every fourth part.
  __device__ __forceinline__ void pull_parts(int pass, const float (&P)[9], long long* sums) const {
#pragma unroll 1
    for (int first = 0; first < count; first += kGroups) {
      const int j = min(first + group, count - 1), k = of_lane(own.k, j);
      const float by = -inverse_size * of_lane(own.side, j);
      const std::int32_t node = of_lane(own.node, j);
      const int number = 1 + __popc(steps & ((1u << j) - 1));
      float slopes[3], force[3];
#pragma unroll
      for (int axis = 0; axis < 3; ++axis) slopes[axis] = slope(k, axis);
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        float of_point = 0;
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
          of_point += of_lane(P[3 * c + axis], kPoints * (number % kGroups) + point) * slopes[axis];
        }
        force[c] = by * sum(of_point);
      }
      const bool is_one = first + group < count && number / kGroups == pass;
      const float mine = point == 0 ? force[0] : point == 1 ? force[1] : force[2];
      if (is_one && point < 3) add_push(sums, front.first_node + node, point, mine);
    }
  }

  /// Forces of the points' stress on the nodes.
  __device__ __forceinline__ void push_nodes(const float (&stress)[9], long long* sums) const {
    const int k = min(lane, 26), of[3] = {k % 3, k / 3 % 3, k / 9};
    float weight[3][2], slope[3][2];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
#pragma unroll
      for (int s = 0; s < 2; ++s) {
        weight[a][s] = SideWeights(s).weight(of[a]);
        slope[a][s] = SideWeights(s).slope(of[a]);
      }
    }
    float force[3] = {};
#pragma unroll
    for (int p = 0; p < kPoints; ++p) {
      const int s[3] = {p & 1, p >> 1 & 1, p >> 2};
      const float by[3] = {slope[0][s[0]] * weight[1][s[1]] * weight[2][s[2]],
                           weight[0][s[0]] * slope[1][s[1]] * weight[2][s[2]],
                           weight[0][s[0]] * weight[1][s[1]] * slope[2][s[2]]};
#pragma unroll
      for (int c = 0; c < 3; ++c) {
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
          force[c] += of_lane(stress[3 * c + axis], p) * by[axis];
        }
      }
    }
    if (lane < 27) add_push(sums, own_node, -inverse_size, force);
  }
};

}  // namespace tissue_sim
