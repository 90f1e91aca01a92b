// mpm/blocks/front_forces.h says what is worked out; there the eight points are the lanes of a
// vector, here a warp has four mixtures of parted nodes with eight points each.
#include "compute/for_each_cuda.h"
#include "material/laws.h"
#include "math/bspline.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/front_cells.h"

namespace tissue_sim {
namespace {

constexpr int kWarp = 32, kTogether = 4;  // energies E_j that a warp works on at once
constexpr unsigned kAllLanes = 0xffffffffu;

struct FrontView {
  const FrontCell* cells;
  const FrontPart* parts;
  const float4 *u, *v, *d, *rate;
};

/// Of a cell in shared memory. Gradients are over the cell size.
struct CellAtWork {
  FrontPart part[27];
  float u[27][3], v[27][3], d[27][3], rate[27][3];  ///< times FrontPart::side and over cell size
  float slope[27][3][8];                            ///< of node k along an axis at a point
  float stress[28][9][8];  ///< of each mixture: 0 where none is parted, j + 1 where the first j + 1
};

__device__ __forceinline__ float slope_of(int k, int axis, int point) {
  const int at[3] = {k % 3, k / 3 % 3, k / 9};
  float value = 1;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int s = point >> a & 1;
    value *= a == axis ? lattice_slope(s, at[a]) : lattice_weight(s, at[a]);
  }
  return value;
}

__device__ __forceinline__ void put(float (&to)[3], float by, const float4& from) {
  to[0] = by * from.x;
  to[1] = by * from.y;
  to[2] = by * from.z;
}

__device__ void bring(const FrontView& view, const FrontCell& cell, CellAtWork& w) {
  const int lane = static_cast<int>(threadIdx.x);
  if (lane < 27) {
    put(w.u[lane], cell.inverse_size, view.u[cell.node[lane]]);
    put(w.v[lane], cell.inverse_size, view.v[cell.node[lane]]);
  }
  if (lane < cell.count) {
    const FrontPart part = view.parts[cell.first + lane];
    w.part[lane] = part;
    put(w.d[lane], cell.inverse_size * part.side, view.d[part.node]);
    put(w.rate[lane], cell.inverse_size * part.side, view.rate[part.node]);
  }
  for (int i = lane; i < 27 * 24; i += kWarp) {
    w.slope[i / 24][i / 8 % 3][i % 8] = slope_of(i / 24, i / 8 % 3, i % 8);
  }
  __syncwarp();
}

__device__ __forceinline__ void add_gradient(const CellAtWork& w, const float (&value)[3], int k,
                                             int point, float (&G)[9]) {
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const float slope = w.slope[k][axis][point];
#pragma unroll
    for (int c = 0; c < 3; ++c) G[3 * c + axis] += value[c] * slope;
  }
}

/// Calls f(j, F, G, rate) for the mixtures 0 (none is parted) to `count` in turn, kTogether of them
/// at once: by all lanes, each for one point, with a j past `count` where there are no more.
template <class F>
__device__ __forceinline__ void for_each_mixture(const FrontCell& cell, const CellAtWork& w,
                                                 bool viscous, const F& f) {
  const int lane = static_cast<int>(threadIdx.x), point = lane % 8, group = lane / 8;
  const bool there = cell.mu[point] > 0;
  float G[9] = {}, rate[9] = {};
  for (int k = 0; k < 27; ++k) {
    add_gradient(w, w.u[k], k, point, G);
    if (viscous) add_gradient(w, w.v[k], k, point, rate);
  }
  int parted = 0;  // of the mixture that G is of
  for (int first = 0; first <= cell.count; first += kTogether) {
    const int j = first + group;
    for (; parted < min(j, cell.count); ++parted) {
      add_gradient(w, w.d[parted], w.part[parted].k, point, G);
      if (viscous) add_gradient(w, w.rate[parted], w.part[parted].k, point, rate);
    }
    float F_there[1][9];
#pragma unroll
    for (int i = 0; i < 9; ++i) F_there[0][i] = (there ? G[i] : 0.0f) + (i % 4 == 0 ? 1.0f : 0.0f);
    f(j, F_there, G, rate);
  }
}

/// Of mixture j, the share of its energy.
__device__ __forceinline__ float share_of(const CellAtWork& w, int j) {
  return j == 0 ? -w.part[0].share : w.part[j - 1].step;
}

/// Sum over the eight lanes of a group, which all get it.
template <class T>
__device__ __forceinline__ T sum_of_points(T value) {
#pragma unroll
  for (int i = 1; i < 8; i *= 2) value += __shfl_xor_sync(kAllLanes, value, i);
  return value;
}

template <class LawOf>
__device__ __forceinline__ void fill_stresses(const FrontCell& cell, CellAtWork& w) {
  const bool viscous = cell.viscosity[0] > 0;
  const int point = static_cast<int>(threadIdx.x) % 8;
  const float mu = cell.mu[point], lambda = cell.lambda[point];
  for_each_mixture(cell, w, viscous,
                   [&](int j, const float(&F)[1][9], const float(&G)[9], const float(&rate)[9]) {
                     float P[1][9];
                     LawOf::template stresses<1>(F, &mu, &lambda, P);
                     if (viscous) {
                       float mean[9], mean_rate[9];
#pragma unroll
                       for (int i = 0; i < 9; ++i) {
                         mean[i] = 0.125f * sum_of_points(G[i]) + (i % 4 == 0 ? 1.0f : 0.0f);
                         mean_rate[i] = 0.125f * sum_of_points(rate[i]);
                       }
                       add_viscous_stress(mean, mean_rate, 0.125f * cell.viscosity[j == 0 ? 0 : 1],
                                          P[0]);
                     }
                     if (j > cell.count) return;
                     const float share = share_of(w, j);
#pragma unroll
                     for (int i = 0; i < 9; ++i)
                       w.stress[j][i][point] = share != 0 ? share * P[0][i] : 0.0f;
                   });
  __syncwarp();
}

/// Value of the number with kinds `of` (A, d, B along each axis) of a field that is 1 at node k.
__device__ __forceinline__ float number_at(int of, int k) {
  float value = 1;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int kind = of % 3, at = k % 3;
    value *= kind == 0   ? (at == 1 ? kAverageCenter : kAverageSide)
             : kind == 1 ? static_cast<float>(at - 1)
                         : (at == 1 ? -2.0f : 1.0f);
    of /= 3;
    k /= 3;
  }
  return value;
}

/// What stabilises motion of the parted nodes alone. Returns the energy, the part of each lane;
/// `pull`, where it is not null, is that of the lane's part.
__device__ __forceinline__ float stabilise_parts(const FrontCell& cell, CellAtWork& w,
                                                 float* pull) {
  const int lane = static_cast<int>(threadIdx.x);
  float(&value)[27][3] = w.u, (&number)[27][3] = w.v;  // both were read
  __syncwarp();
  if (lane < 27) value[lane][0] = value[lane][1] = value[lane][2] = 0;
  __syncwarp();
  float by = 0;
  if (lane < cell.count) {
    const FrontPart& part = w.part[lane];
    by = sqrtf(part.share);
    for (int c = 0; c < 3; ++c) value[part.k][c] = by * w.d[lane][c];
    by *= part.side * cell.inverse_size;
  }
  __syncwarp();
  float energy = 0;
  if (lane < 27) {
    const float weight = cell.stabilised * stabilisation::weight2(lane % 3, lane / 3 % 3, lane / 9);
    for (int c = 0; c < 3; ++c) {
      float sum = 0;
      for (int k = 0; k < 27; ++k) sum += number_at(lane, k) * value[k][c];
      number[lane][c] = weight * sum;
      energy += 0.5f * weight * sum * sum;
    }
  }
  __syncwarp();
  if (pull != nullptr && lane < cell.count) {
    for (int c = 0; c < 3; ++c) {
      float force = 0;
      for (int i = 0; i < 27; ++i) force += number_at(i, w.part[lane].k) * number[i][c];
      pull[c] -= by * force;
    }
  }
  return energy;
}

/// One warp for each cell.
__global__ void __launch_bounds__(kWarp)
    front_forces(const FrontView view, float4* all_force, float4* all_pull) {
  __shared__ CellAtWork w;
  __shared__ FrontCell cell;
  const int lane = static_cast<int>(threadIdx.x);
  const auto* from = reinterpret_cast<const std::int32_t*>(view.cells + blockIdx.x);
  for (int i = lane; i < static_cast<int>(sizeof(FrontCell) / 4); i += kWarp) {
    reinterpret_cast<std::int32_t*>(&cell)[i] = from[i];
  }
  __syncwarp();
  bring(view, cell, w);
  if (cell.law == Law::kNeoHookean) {
    fill_stresses<NeoHookean>(cell, w);
  } else {
    fill_stresses<FixedCorotated>(cell, w);
  }
  // Of what part j moves: the mixtures in which it is parted, j + 1 and after.
  for (int i = lane; i < 72; i += kWarp) {
    float sum = 0;
    for (int j = cell.count; j >= 0; --j) {
      sum += w.stress[j][i / 8][i % 8];
      w.stress[j][i / 8][i % 8] = sum;
    }
  }
  __syncwarp();
  const auto force_at = [&](int mixture, int k, float by, float(&force)[3]) {
    for (int c = 0; c < 3; ++c) {
      float sum = 0;
      for (int axis = 0; axis < 3; ++axis) {
        for (int p = 0; p < 8; ++p) sum += w.stress[mixture][3 * c + axis][p] * w.slope[k][axis][p];
      }
      force[c] = by * sum;
    }
  };
  float force[3], pull[3];
  if (lane < 27) {
    force_at(0, lane, -cell.inverse_size, force);
    all_force[28 * static_cast<std::size_t>(blockIdx.x) + lane] = {force[0], force[1], force[2], 0};
  }
  if (lane < cell.count) {
    force_at(lane + 1, w.part[lane].k, -cell.inverse_size * w.part[lane].side, pull);
  }
  if (cell.stabilised > 0) stabilise_parts(cell, w, pull);
  if (lane < cell.count) all_pull[cell.first + lane] = {pull[0], pull[1], pull[2], 0};
}

__global__ void __launch_bounds__(kWarp) front_energies(const FrontView view, double* energy) {
  __shared__ CellAtWork w;
  const FrontCell& cell = view.cells[blockIdx.x];
  const int lane = static_cast<int>(threadIdx.x), point = lane % 8;
  bring(view, cell, w);
  const float mu = cell.mu[point], lambda = cell.lambda[point];
  double sum = 0;
  for_each_mixture(cell, w, false,
                   [&](int j, const float(&F)[1][9], const float(&)[9], const float(&)[9]) {
                     float of_point = 0;
                     if (cell.law == Law::kNeoHookean) {
                       NeoHookean::energies<1>(F, &mu, &lambda, &of_point);
                     } else {
                       FixedCorotated::energies<1>(F, &mu, &lambda, &of_point);
                     }
                     if (j > cell.count || share_of(w, j) == 0) return;
                     sum += static_cast<double>(share_of(w, j)) * of_point;
                   });
  if (cell.stabilised > 0) sum += stabilise_parts(cell, w, nullptr);
  for (int i = 1; i < kWarp; i *= 2) sum += __shfl_xor_sync(kAllLanes, sum, i);
  if (lane == 0) energy[blockIdx.x] = sum;
}

/// Of nodes, then of parted nodes.
struct MoveFront {
  const FrontSum *node_sums, *part_sums;
  const std::int32_t *node_places, *part_places;
  int nodes;
  const float4 *force, *pull;
  float4 *u, *v, *d, *rate;
  NodeStep step;

  __device__ void operator()(int i) const {
    const bool of_node = i < nodes;
    const FrontSum sum = of_node ? node_sums[i] : part_sums[i - nodes];
    const std::int32_t* place = (of_node ? node_places : part_places) + sum.first;
    const float4* from = of_node ? force : pull;
    float4 total = {0, 0, 0, 0};
    for (int k = 0; k < sum.count; ++k) {
      const float4 f = from[place[k] / 4];  // they count floats
      total.x += f.x;
      total.y += f.y;
      total.z += f.z;
    }
    if (of_node) {
      // The node was moved on as if this force were not: the step is linear in it.
      float4 &to = u[sum.node], &speed = v[sum.node];
      const float by = step.kick * speed.w;
      speed = {speed.x + by * total.x, speed.y + by * total.y, speed.z + by * total.z, speed.w};
      to = {to.x + step.dt * by * total.x, to.y + step.dt * by * total.y,
            to.z + step.dt * by * total.z, to.w};
      return;
    }
    float4 &to = d[sum.node], &speed = rate[sum.node];
    const float by = step.kick / to.w;
    speed = {step.keep * speed.x + by * total.x, step.keep * speed.y + by * total.y,
             step.keep * speed.z + by * total.z, 0};
    to = {to.x + step.dt * speed.x, to.y + step.dt * speed.y, to.z + step.dt * speed.z, to.w};
  }
};

FrontView view_of(const FrontOnDevice& front, const CudaNodes& state) {
  return {front.cells.data(), front.parts.data(), state.u, state.v,
          front.d.data(),     front.rate.data()};
}

}  // namespace

void launch_front_cells(const FrontOnDevice& front, const CudaNodes& state, cudaStream_t stream) {
  front_forces<<<static_cast<unsigned>(front.cells.size()), kWarp, 0, stream>>>(
      view_of(front, state), front.force.data(), front.pull.data());
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_move_front(const FrontOnDevice& front, const CudaNodes& moved, const NodeStep& step,
                       cudaStream_t stream) {
  const int nodes = static_cast<int>(front.node_sums.size());
  Gpu(stream).for_each(
      nodes + static_cast<int>(front.part_sums.size()),
      MoveFront{front.node_sums.data(), front.part_sums.data(), front.node_places.data(),
                front.part_places.data(), nodes, front.force.data(), front.pull.data(), moved.u,
                moved.v, front.d.data(), front.rate.data(), step});
}

void launch_front_energy(const FrontOnDevice& front, const CudaNodes& state, cudaStream_t stream) {
  front_energies<<<static_cast<unsigned>(front.cells.size()), kWarp, 0, stream>>>(
      view_of(front, state), front.energy.data());
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace tissue_sim
