#include "compute/for_each_cuda.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/front_warp.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 64;

/// A warp for each cell.
__global__ void __launch_bounds__(kThreads)
    front_energy(const CudaFront front, const CudaNodes state, double* energy) {
  const int i = static_cast<int>(blockIdx.x * kThreads + threadIdx.x) / 32;
  if (i >= front.cell_count) return;
  FrontWarp cell(front, i);
  cell.bring(state);
  double sum =
      cell.cell.law == Law::kNeoHookean ? cell.energy<NeoHookean>() : cell.energy<FixedCorotated>();
  if (cell.cell.stabilised > 0) sum += cell.stabilise<false>(nullptr);
  if (cell.lane == 0) energy[i] = sum;
}

struct MotionOfParted {
  CudaFront front;
  CudaNodes state;
  double* energy;
  __device__ void operator()(int i) const {
    const float mass = state.u[front.first_node + i].w;
    const float4 v = state.v[front.first_node + i];
    energy[i] = 0.5 * mass *
                (static_cast<double>(v.x) * v.x + static_cast<double>(v.y) * v.y +
                 static_cast<double>(v.z) * v.z);
  }
};

struct Unmark {
  std::uint8_t* marks;
  __device__ void operator()(int i) const { marks[i] &= ~kMarkedByFront; }
};

struct Mark {
  CudaFront front;
  std::uint8_t* marks;
  __device__ void operator()(int i) const {
    marks[front.cells[i / 27].node[i % 27]] |= kMarkedByFront;
  }
};

}  // namespace

void launch_front_energy(const CudaFront& front, const CudaNodes& state, double* energy,
                         cudaStream_t stream) {
  if (front.cell_count == 0) return;
  const int blocks = (32 * front.cell_count + kThreads - 1) / kThreads;
  front_energy<<<blocks, kThreads, 0, stream>>>(front, state, energy);
  check_cuda(cudaGetLastError(), "start a kernel");
  Gpu(stream).for_each(front.node_count, MotionOfParted{front, state, energy + front.cell_count});
}

void launch_mark_front(const CudaFront& front, std::uint8_t* marks, std::size_t node_count,
                       cudaStream_t stream) {
  Gpu gpu(stream);
  gpu.for_each(static_cast<int>(node_count), Unmark{marks});
  gpu.for_each(27 * front.cell_count, Mark{front, marks});
}

}  // namespace tissue_sim
