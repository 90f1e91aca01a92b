// All steps of a frame by one block of threads: for tissue of few constraints, where what takes the
// time is to wait between colours. Within a block of threads that is a hundredth of a launch, and
// places are in its shared memory.
#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {
namespace {

template <class Kind>
__device__ __forceinline__ void forget_multipliers(const CudaPbdSet<Kind>& set) {
  if (set.colours == 0) return;
  const int count = set.begin[set.colours] * (ConstraintSet<Kind>::kMultipliers * kLanes);
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    set.multipliers[i] = 0;
  }
}

/// Threads of a block: tetrahedra take twice the registers.
template <bool kTets>
constexpr int kThreads = kTets ? 512 : 1024;

template <bool kTets, bool kKeep>
__global__ void __launch_bounds__(kThreads<kTets>, 1)
    pbd_steps(CudaPbdField f, CudaPbdFrame frame, int steps) {
  extern __shared__ float4 places[];
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  for (int i = thread; i < f.count + 4 * kLanes; i += threads) places[i] = f.x[i];
  const StepNumbers& step = frame.step;
  const float inverse_h2 = step.inverse_h2;
  for (int s = 0; s < steps; ++s) {
    if (kKeep) {
      if (kTets) forget_multipliers(f.elastics);
      forget_multipliers(f.links);
      forget_multipliers(f.bends);
    }
    for (int i = thread; i < f.count; i += threads) predict_vertex(f, step, i, places + i);
    __syncthreads();
    for (int iteration = 0; iteration < f.iterations; ++iteration) {
      if (kTets) {
        project_colours<Elastic, kKeep>(f.elastics, 0, f.elastics.colours, inverse_h2, places);
        project_colours<Strain, false>(f.strains, 0, f.strains.colours, inverse_h2, places);
      }
      project_colours<Distance, kKeep>(f.links, 0, f.links.colours, inverse_h2, places);
      project_colours<Bending, kKeep>(f.bends, 0, f.bends.colours, inverse_h2, places);
      const std::size_t first = static_cast<std::size_t>(s) * frame.colliders;
      for (int i = thread; i < f.count; i += threads) {
        touch_vertex(f, step.h, f.colliders + first, frame.colliders,
                     f.loads + first * kPbdLoadSums, i, places + i);
      }
      __syncthreads();
    }
    for (int i = thread; i < f.count; i += threads) take_velocity_of(f, step, i, places[i]);
  }
  for (int i = thread; i < f.count; i += threads) f.x[i] = places[i];
}

std::size_t shared_bytes(const CudaPbdField& field) {
  return (static_cast<std::size_t>(field.count) + 4 * kLanes) * sizeof(float4);
}

template <bool kTets, bool kKeep>
void launch(const CudaPbdField& field, const CudaPbdFrame& frame, int steps, cudaStream_t stream) {
  const std::size_t bytes = shared_bytes(field);
  check_cuda(
      cudaFuncSetAttribute(pbd_steps<kTets, kKeep>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                           static_cast<int>(bytes)),
      "set shared memory apart");
  pbd_steps<kTets, kKeep><<<1, kThreads<kTets>, bytes, stream>>>(field, frame, steps);
  check_cuda(cudaGetLastError(), "take the steps of a frame");
}

}  // namespace

bool fits_pbd_block(const CudaPbdField& field) {
  int most = 0;
  check_cuda(cudaDeviceGetAttribute(&most, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0), "be asked");
  return shared_bytes(field) <= static_cast<std::size_t>(most);
}

void launch_pbd_steps(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                      cudaStream_t stream) {
  const bool tets = field.elastics.colours + field.strains.colours > 0;
  if (field.iterations > 1) {
    tets ? launch<true, true>(field, frame, steps, stream)
         : launch<false, true>(field, frame, steps, stream);
  } else {
    tets ? launch<true, false>(field, frame, steps, stream)
         : launch<false, false>(field, frame, steps, stream);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
