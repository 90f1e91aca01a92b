// A cell at the front of a cut, worked on by a warp. For .cu files.
//
// Of the stresses that make up its energy (mpm/blocks/front_stress.h), four are a warp's work at a
// time, a pass: eight lanes, one for each point of the cell, have one of them. Of nodes, parts and
// numbers of stabilisation each lane has one. Passes know nothing of each other: what each adds to
// the forces are those of its stresses.
#pragma once

#include "math/bspline.h"
#include "mpm/blocks/front_stress.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/added_mass.h"
#include "mpm/cuda/tables.h"

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
  int begins;      ///< number of the first stress in which the lane's part is parted
  float inverse_size, mu_here, lambda_here;
  bool viscous;
  SideWeights along[3] = {SideWeights(lane & 1), SideWeights(lane >> 1 & 1),
                          SideWeights(lane >> 2 & 1)};
  std::int32_t own_node;  ///< of number min(lane, 26) of the cell's
  FrontPart own;          ///< of number min(lane, count - 1) of the cell's
  float u[3], v[3];       ///< of the node
  float d[3], rate[3];    ///< of the part, as its points see it

  __device__ __forceinline__ FrontWarp(const CudaFront& f, int i)
      : FrontWarp(f, i, f.cells[i].first, f.cells[i].count) {}
  /// Where the cell's first part and their count are known before it.
  __device__ __forceinline__ FrontWarp(const CudaFront& f, int i, int first, int parts)
      : front(f), cell(f.cells[i]), count(parts) {
    const FrontPart* part = front.parts + first + min(lane, count - 1);
    own = {__ldg(&part->node),       __ldg(&part->k),    __ldg(&part->side),
           __ldg(&part->share),      __ldg(&part->step), __ldg(&part->volume_share),
           __ldg(&part->volume_step)};
    own_node = __ldg(cell.node + min(lane, 26));
    inverse_size = __ldg(&cell.inverse_size);
    mu_here = __ldg(cell.mu + point);
    lambda_here = __ldg(cell.lambda + point);
    viscous = any(__ldg(cell.viscosity) > 0 && __ldg(cell.viscosity + 1) > 0);  // both or none
    steps = __ballot_sync(kAll, lane < count && own.step > 0);
    begins = 1 + __popc(steps & ((1u << lane) - 1));
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
    const float side = own.side;
    u[0] = at.x, u[1] = at.y, u[2] = at.z;
    v[0] = speed.x, v[1] = speed.y, v[2] = speed.z;
    d[0] = side * apart.x, d[1] = side * apart.y, d[2] = side * apart.z;
    rate[0] = side * speed_apart.x, rate[1] = side * speed_apart.y, rate[2] = side * speed_apart.z;
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

  /// Of what all lanes have alike, too: the compiler then knows that they go the same way, and need
  /// not wait for each other at each shuffle.
  __device__ __forceinline__ static bool any(bool x) { return __any_sync(kAll, x) != 0; }
  template <class Value>
  __device__ __forceinline__ static Value of_lane(Value x, int which) {
    return __shfl_sync(kAll, x, which);
  }

  __device__ __forceinline__ int passes() const { return 1 + __popc(steps) / kGroups; }
  /// Number of the group's stress in a pass, 0 for that with no node parted.
  __device__ __forceinline__ int number(int pass) const { return kGroups * pass + group; }
  /// The parts that begin to be parted in the group's stress of a pass, as bits.
  __device__ __forceinline__ unsigned own_parts(int pass) const {
    unsigned mine = 0;
#pragma unroll
    for (int g = 0; g < kGroups; ++g) {
      const unsigned of_group = __ballot_sync(kAll, lane < count && begins == kGroups * pass + g);
      mine = group == g ? of_group : mine;
    }
    return mine;
  }
  /// How much of its energy is the cell's: 0 where there is none of that number. `parts`: its own.
  __device__ __forceinline__ front::Weights weights(int pass, unsigned parts) const {
    const unsigned one = parts & steps;
    const int which = max(__ffs(static_cast<int>(one)) - 1, 0);
    const float step = of_lane(own.step, which), volume_step = of_lane(own.volume_step, which),
                largest = of_lane(own.share, 0), largest_volume = of_lane(own.volume_share, 0);
    return {number(pass) == 0 ? -largest
            : one != 0        ? step
                              : 0.0f,
            number(pass) == 0 ? -largest_volume
            : one != 0        ? volume_step
                              : 0.0f};
  }

  /// Adds the gradient of `parts`, bits that are of the group's own.
  template <bool kRate>
  __device__ __forceinline__ void add_parts(unsigned parts, float (&G)[9]) const {
    while (any(parts != 0)) {  // two at a time, for one not to wait for the other
      float value[2][3];
      int k[2];
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        const int j = max(__ffs(static_cast<int>(parts)) - 1, 0);
        k[i] = of_lane(own.k, j);
#pragma unroll
        for (int c = 0; c < 3; ++c) {
          value[i][c] = of_lane(kRate ? rate[c] : d[c], j);
          value[i][c] = parts != 0 ? value[i][c] : 0.0f;
        }
        parts &= parts - 1;
      }
#pragma unroll
      for (int i = 0; i < 2; ++i) front::add_gradient(*this, value[i], k[i], G);
    }
  }
  /// Gradient of displacement or velocity, [9], in the group's stress of a pass. Three groups have
  /// a plane of nodes each, and all those parts that begin with one of their number, of which the
  /// groups behind have them, too.
  template <bool kRate>
  __device__ __forceinline__ void gradient(int pass, unsigned parts, float (&G)[9]) const {
    const int z = min(group, 2);
    const float weight = group < 3 ? along[2].weight(z) : 0.0f,
                slope = group < 3 ? along[2].slope(z) : 0.0f;
#pragma unroll
    for (int i = 0; i < 9; ++i) G[i] = 0;
#pragma unroll
    for (int y = 0; y < 3; ++y) {
      float wx[3] = {}, dx[3] = {};
#pragma unroll
      for (int x = 0; x < 3; ++x) {
#pragma unroll
        for (int c = 0; c < 3; ++c) {
          const float value = of_lane(kRate ? v[c] : u[c], 9 * z + 3 * y + x);
          wx[c] += along[0].weight(x) * value;
          dx[c] += along[0].slope(x) * value;
        }
      }
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        G[3 * c] += along[1].weight(y) * weight * dx[c];
        G[3 * c + 1] += along[1].slope(y) * weight * wx[c];
        G[3 * c + 2] += along[1].weight(y) * slope * wx[c];
      }
    }
    if (any(pass > 0)) {  // parts of the passes before
      const bool is_early = lane < count && begins < kGroups * pass;
      add_parts<kRate>(__ballot_sync(kAll, is_early) & 0x11111111u << group, G);
    }
    float more[9] = {};
    add_parts<kRate>(parts, more);
#pragma unroll
    for (int i = 0; i < 9; ++i) {
      G[i] += __shfl_xor_sync(kAll, G[i], 8);
      G[i] += __shfl_xor_sync(kAll, G[i], 16);
      float before = __shfl_up_sync(kAll, more[i], kPoints);
      more[i] += group > 0 ? before : 0.0f;
      before = __shfl_up_sync(kAll, more[i], 2 * kPoints);
      more[i] += group > 1 ? before : 0.0f;
      G[i] = inverse_size * (G[i] + more[i]);
    }
  }

  /// Adds to the sums of forces (NodePushes) those of the stresses of a pass.
  template <class LawOf>
  __device__ __forceinline__ void push(int pass, long long* sums) const {
    float G[9], G_rate[9] = {}, P[9];
    const unsigned parts = own_parts(pass);
    gradient<false>(pass, parts, G);
    if (viscous) gradient<true>(pass, parts, G_rate);
    const front::Weights share = weights(pass, parts);
    const float viscosity = __ldg(cell.viscosity + (number(pass) == 0 ? 0 : 1));
    front::stress<LawOf>(*this, G, G_rate, viscous ? viscosity : 0.0f, share, P);
#pragma unroll
    for (int i = 0; i < 9; ++i) {  // with those of the groups behind
      float x = share.shape == 0 ? 0.0f : P[i];
      float behind = __shfl_down_sync(kAll, x, kPoints);
      x += group < 3 ? behind : 0.0f;
      behind = __shfl_down_sync(kAll, x, 2 * kPoints);
      x += group < 2 ? behind : 0.0f;
      P[i] = x;
    }
    float on_node[3], on_part[3];
    const int first = begins - kGroups * pass;
    pull(P, min(max(first, 0), kGroups - 1), on_node, on_part);
    const float side = first < kGroups ? own.side : 0.0f;
#pragma unroll
    for (float& x : on_part) x *= side;
    if (lane < 27) add_push(sums, own_node, 1.0f, on_node);
    if (lane < count) add_push(sums, front.first_node + own.node, 1.0f, on_part);
  }

  /// Energy of its points, above the block's [J].
  template <class LawOf>
  __device__ __forceinline__ double energy() const {
    double sum = 0;
#pragma unroll 1
    for (int pass = 0; pass < passes(); ++pass) {
      float G[9], F[1][9], of_points;
      const unsigned parts = own_parts(pass);
      gradient<false>(pass, parts, G);
      front::deformation(*this, G, F[0]);
      const front::Weights share = weights(pass, parts);
      float mu, lambda;
      front::weigh(*this, share, mu, lambda);
      LawOf::template energies<1>(F, &mu, &lambda, &of_points);
      sum += share.shape == 0 ? 0.0f : of_points;
    }
    return all(sum);
  }

  /// What resists motion of the cell's parts without strain (mpm/blocks/stabilisation.h): with
  /// kPulls adds its pull on them. Returns the energy [J]. Of 27 nodes to numbers and back goes one
  /// axis after the other.
  template <bool kPulls>
  __device__ __forceinline__ double stabilise(long long* sums) const {
    const float root = sqrtf(own.share) * inverse_size;
    float x[3] = {};  // of the lane's node, then of its number
#pragma unroll 2
    for (int j = 0; j < count; ++j) {
      const bool is_its_node = of_lane(own.k, j) == lane;
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        const float value = of_lane(root * d[c], j);
        x[c] = is_its_node ? value : x[c];
      }
    }
    along_axes<false>(x);
    const int kind[3] = {lane % 3, lane / 3 % 3, min(lane / 9, 2)};
    const float stiffness =
        lane < 27 ? cell.stabilised * stabilisation::weight2(kind[0], kind[1], kind[2]) : 0.0f;
    float twice_energy = 0;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      twice_energy += stiffness * x[c] * x[c];
      x[c] *= stiffness;
    }
    if (!kPulls) return 0.5 * all(twice_energy);
    along_axes<true>(x);
#pragma unroll
    for (float& of_node : x) of_node = of_lane(of_node, own.k);
    if (lane < count) add_push(sums, front.first_node + own.node, -root * own.side, x);
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

  /// From what nodes have to the numbers A, d, B along each axis; or, transposed, from these back.
  template <bool kBack>
  __device__ __forceinline__ void along_axes(float (&x)[3]) const {
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const int stride = axis == 0 ? 1 : axis == 1 ? 3 : 9;
      const int here = min(lane, 26) / stride % 3, first = min(lane, 26) - here * stride;
      float sum[3] = {};
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        const float share = kBack ? share_along(i, here) : share_along(here, i);
#pragma unroll
        for (int c = 0; c < 3; ++c) sum[c] += share * of_lane(x[c], first + i * stride);
      }
#pragma unroll
      for (int c = 0; c < 3; ++c) x[c] = sum[c];
    }
  }

  /// Weights of node k at points of side 0 and 1, and slopes times the cell size.
  struct OfNode {
    float weight[3][2], slope[3][2];
    __device__ __forceinline__ explicit OfNode(int k) {
      const int of[3] = {k % 3, k / 3 % 3, k / 9};
#pragma unroll
      for (int a = 0; a < 3; ++a) {
#pragma unroll
        for (int s = 0; s < 2; ++s) {
          weight[a][s] = SideWeights(s).weight(of[a]);
          slope[a][s] = SideWeights(s).slope(of[a]);
        }
      }
    }
    /// Slopes along each axis at point p.
    __device__ __forceinline__ void at(int p, float (&by)[3]) const {
      float w[3], d[3];
#pragma unroll
      for (int a = 0; a < 3; ++a) {
        const bool other = (p >> a & 1) != 0;
        w[a] = other ? weight[a][1] : weight[a][0];
        d[a] = other ? slope[a][1] : slope[a][0];
      }
      by[0] = d[0] * w[1] * w[2];
      by[1] = w[0] * d[1] * w[2];
      by[2] = w[0] * w[1] * d[2];
    }
  };

  /// Forces of the points' stress on the lane's node, of all that its groups have, and on its part,
  /// of what the group `first` has.
  __device__ __forceinline__ void pull(const float (&P)[9], int first, float (&on_node)[3],
                                       float (&on_part)[3]) const {
    const OfNode node(min(lane, 26)), part(own.k);
#pragma unroll
    for (int c = 0; c < 3; ++c) on_node[c] = on_part[c] = 0;
#pragma unroll 4
    for (int p = 0; p < kPoints; ++p) {
      float of_node[3], of_part[3];
      node.at(p, of_node);
      part.at(p, of_part);
#pragma unroll
      for (int c = 0; c < 3; ++c) {
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
          on_node[c] += of_lane(P[3 * c + axis], p) * of_node[axis];
          on_part[c] += of_lane(P[3 * c + axis], kPoints * first + p) * of_part[axis];
        }
      }
    }
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      on_node[c] *= -inverse_size;
      on_part[c] *= -inverse_size;
    }
  }
};

}  // namespace tissue_sim
