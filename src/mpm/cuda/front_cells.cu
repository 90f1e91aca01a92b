#include "compute/for_each_cuda.h"
#include "math/bspline.h"
#include "mpm/blocks/front_stress.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/cuda/front_cells.h"

namespace tissue_sim {
namespace {

constexpr int kLanes = 8;     // of a warp for a cell, one for each of its points
constexpr int kThreads = 64;  // of a thread block: few, for cells to go to many multiprocessors
constexpr int kCellNodes = kFrontForce / 4;

/// Slope of the weight of node k of a cell's 27 at its point p, times the cell size.
__device__ __forceinline__ float slope_at(int p, int k, int axis) {
  const int d[3] = {k % 3, k / 3 % 3, k / 9};
  float value = 1;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    value *= a == axis ? lattice_slope(p >> a & 1, d[a]) : lattice_weight(p >> a & 1, d[a]);
  }
  return value;
}

/// Share that node k of a cell has in the number of kinds (0 A, 1 d, 2 B) x + 3 y + 9 z.
__device__ __forceinline__ float share_in(int kinds, int k) {
  const auto along = [](int kind, int d) {
    if (kind == 0) return d == 1 ? kAverageCenter : kAverageSide;
    return kind == 1 ? static_cast<float>(d - 1) : (d == 1 ? -2.0f : 1.0f);
  };
  return along(kinds % 3, k % 3) * along(kinds / 3 % 3, k / 3 % 3) * along(kinds / 9, k / 9);
}

/// The eight points of a cell, a lane each: mpm/blocks/front_stress.h.
struct LanePoints {
  using T = float;
  const CudaFront& front;
  const CudaNodes& state;
  const FrontCell& cell;
  int lane = static_cast<int>(threadIdx.x) % kLanes;
  unsigned mask = ((1u << kLanes) - 1) << (threadIdx.x % 32 - lane);

  __device__ __forceinline__ LanePoints(const CudaFront& f, const CudaNodes& nodes, int i)
      : front(f), state(nodes), cell(f.cells[i]) {}
  __device__ __forceinline__ const FrontPart& part(int j) const {
    return front.parts[cell.first + j];
  }
  __device__ __forceinline__ float slope(int k, int axis) const { return slope_at(lane, k, axis); }
  __device__ __forceinline__ float mu() const { return cell.mu[lane]; }
  __device__ __forceinline__ float lambda() const { return cell.lambda[lane]; }
  __device__ __forceinline__ float keep(float x) const { return cell.mu[lane] > 0 ? x : 0.0f; }
  __device__ __forceinline__ float sum(float x) const {
#pragma unroll
    for (const int step : {4, 1, 2}) x += __shfl_xor_sync(mask, x, step);
    return x;
  }
  template <bool kRate>
  __device__ __forceinline__ void node(int n, float (&x)[3]) const {
    const float4 value = kRate ? state.v[n] : state.u[n];
    x[0] = value.x, x[1] = value.y, x[2] = value.z;
  }
  template <bool kRate>
  __device__ __forceinline__ void parted(int n, float (&x)[3]) const {
    node<kRate>(front.first_node + n, x);
  }
  __device__ __forceinline__ float* pull_on(int j, int c) const {
    return reinterpret_cast<float*>(front.pull + cell.first + j) + c;
  }
  __device__ __forceinline__ void pull(int j, int c, float force) const {
    if (lane == 0) *pull_on(j, c) = force;
  }
};

/// Forces of the cell's stress on its nodes.
__device__ __forceinline__ void push_nodes(const LanePoints& p, const float (&stress)[9], int i) {
  constexpr int kInHand = 4;  // nodes of a lane: every eighth
  float force[kInHand][3] = {};
  for (int point = 0; point < kLanes; ++point) {
    float of_point[9];
#pragma unroll
    for (int n = 0; n < 9; ++n) of_point[n] = __shfl_sync(p.mask, stress[n], point, kLanes);
#pragma unroll
    for (int m = 0; m < kInHand; ++m) {
#pragma unroll
      for (int axis = 0; axis < 3; ++axis) {
        const float slope = slope_at(point, p.lane + kLanes * m, axis);
#pragma unroll
        for (int c = 0; c < 3; ++c) force[m][c] += of_point[3 * c + axis] * slope;
      }
    }
  }
  const float by = -p.cell.inverse_size;
#pragma unroll
  for (int m = 0; m < kInHand; ++m) {
    const int k = p.lane + kLanes * m;
    if (k >= 27) continue;
    p.front.force[kCellNodes * i + k] = {by * force[m][0], by * force[m][1], by * force[m][2], 0};
  }
}

/// What resists motion of the cell's parts without strain (mpm/blocks/stabilisation.h), each lane
/// with every eighth of the 27 numbers: adds its pull on them. Returns the energy [J].
template <bool kPulls>
__device__ double stabilise(const LanePoints& p) {
  constexpr int kInHand = 4;
  const FrontCell& cell = p.cell;
  const auto by = [&](const FrontPart& part) {
    return sqrtf(part.share) * part.side * cell.inverse_size;
  };
  float number[kInHand][3] = {}, twice_energy = 0;
  for (int j = 0; j < cell.count; ++j) {
    const FrontPart part = p.part(j);
    float d[3];
    p.parted<false>(part.node, d);
#pragma unroll
    for (int m = 0; m < kInHand; ++m) {
      const float share = by(part) * share_in(p.lane + kLanes * m, part.k);
#pragma unroll
      for (int c = 0; c < 3; ++c) number[m][c] += share * d[c];
    }
  }
#pragma unroll
  for (int m = 0; m < kInHand; ++m) {
    const int kinds = p.lane + kLanes * m;
    const float stiffness =
        kinds < 27 ? cell.stabilised * stabilisation::weight2(kinds % 3, kinds / 3 % 3, kinds / 9)
                   : 0.0f;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      twice_energy += stiffness * number[m][c] * number[m][c];
      number[m][c] *= stiffness;
    }
  }
  for (int j = 0; kPulls && j < cell.count; ++j) {
    const FrontPart part = p.part(j);
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      float force = 0;
#pragma unroll
      for (int m = 0; m < kInHand; ++m) {
        force += share_in(p.lane + kLanes * m, part.k) * number[m][c];
      }
      force = p.sum(force);
      if (p.lane == 0) *p.pull_on(j, c) -= by(part) * force;
    }
  }
  return 0.5 * p.sum(twice_energy);
}

__device__ __forceinline__ int group_index() {
  return static_cast<int>(blockIdx.x * kThreads + threadIdx.x) / kLanes;
}

__global__ void __launch_bounds__(kThreads)
    front_forces(const CudaFront front, const CudaNodes state) {
  const int i = group_index();
  if (i >= front.cell_count) return;
  const LanePoints p(front, state, i);
  float stress[9];
  if (p.cell.law == Law::kNeoHookean) {
    front::stresses<NeoHookean>(p, stress);
  } else {
    front::stresses<FixedCorotated>(p, stress);
  }
  push_nodes(p, stress, i);
  if (p.cell.stabilised > 0) stabilise<true>(p);
}

__global__ void __launch_bounds__(kThreads)
    front_energy(const CudaFront front, const CudaNodes state) {
  const int i = group_index();
  if (i >= front.cell_count) return;
  const LanePoints p(front, state, i);
  double energy = p.cell.law == Law::kNeoHookean ? front::energy<NeoHookean>(p)
                                                 : front::energy<FixedCorotated>(p);
  if (p.cell.stabilised > 0) energy += stabilise<false>(p);
  if (p.lane == 0) front.energy[i] = energy;
}

struct MoveFront {
  CudaFront front;
  NodeStep step;
  CudaNodes from, to;
  __device__ void operator()(int i) const {
    const CudaFrontSum& sum = front.sums[i];
    const bool of_node = i < front.first_parted;
    const float4* forces = of_node ? front.force : front.pull;
    float f[3] = {};
    for (int k = 0; k < sum.count; ++k) {
      const float4 more = forces[front.places[sum.first + k]];
      f[0] += more.x;
      f[1] += more.y;
      f[2] += more.z;
    }
    // A node was moved on as if this force were not: the step is linear in it.
    float4 u = (of_node ? to : from).u[sum.node], v = (of_node ? to : from).v[sum.node];
    const float kick_over_m = step.kick * v.w, keep = of_node ? 1.0f : step.keep;
    const float more[3] = {kick_over_m * f[0], kick_over_m * f[1], kick_over_m * f[2]};
    const float rate[3] = {keep * v.x + more[0], keep * v.y + more[1], keep * v.z + more[2]};
    const float* way = of_node ? more : rate;
    u.x += step.dt * way[0];
    u.y += step.dt * way[1];
    u.z += step.dt * way[2];
    to.u[sum.node] = u;
    to.v[sum.node] = {rate[0], rate[1], rate[2], v.w};
  }
};

struct MotionOfParted {
  CudaFront front;
  CudaNodes state;
  __device__ void operator()(int i) const {
    const float mass = state.u[front.first_node + i].w;
    const float4 v = state.v[front.first_node + i];
    front.energy[front.cell_count + i] =
        0.5 * mass *
        (static_cast<double>(v.x) * v.x + static_cast<double>(v.y) * v.y +
         static_cast<double>(v.z) * v.z);
  }
};

int blocks_for(const CudaFront& front) {
  return (kLanes * front.cell_count + kThreads - 1) / kThreads;
}

}  // namespace

void launch_front_forces(const CudaFront& front, const CudaNodes& state, cudaStream_t stream) {
  if (front.cell_count == 0) return;
  front_forces<<<blocks_for(front), kThreads, 0, stream>>>(front, state);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_move_front(const CudaFront& front, const NodeStep& step, const CudaNodes& from,
                       const CudaNodes& to, cudaStream_t stream) {
  Gpu(stream).for_each(front.sum_count, MoveFront{front, step, from, to});
}

void launch_front_energy(const CudaFront& front, const CudaNodes& state, cudaStream_t stream) {
  if (front.cell_count == 0) return;
  front_energy<<<blocks_for(front), kThreads, 0, stream>>>(front, state);
  check_cuda(cudaGetLastError(), "start a kernel");
  Gpu(stream).for_each(front.node_count, MotionOfParted{front, state});
}

}  // namespace tissue_sim
