// All steps of a frame by one block of threads: for tissue of few constraints, where what takes the
// time is to wait between colours. Within a block of threads that is a hundredth of a launch, and
// places are in its shared memory.
#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// A chunk for each warp, in a fixed order.
__device__ __forceinline__ void sum_flights(const CudaPbdField& f, const CudaPbdFlights& flights,
                                            const float4* x, CudaPbdFlight* result) {
  const int lane = static_cast<int>(threadIdx.x) % 32, warps = static_cast<int>(blockDim.x) / 32;
  for (int c = static_cast<int>(threadIdx.x) / 32; c < flights.count; c += warps) {
    const CudaPbdChunk chunk = flights.chunks[c];
    const float4 origin = x[chunk.first];
    CudaPbdFlight sum = {{origin.x, origin.y, origin.z}, {}, {}, {}, {}, 0};
    for (int k = chunk.begin + lane; k < chunk.end; k += 32) {
      const int i = flights.order[k];
      add_to_flight(x[i], f.v[i], f.mass[i], f.pushed[i], sum);
    }
#pragma unroll
    for (int step = 16; step > 0; step /= 2) {
#pragma unroll
      for (int k = 0; k < 3; ++k) {
        for (double* s : {sum.moment + k, sum.linear + k, sum.angular + k, sum.second + k,
                          sum.second + 3 + k}) {
          *s += __shfl_down_sync(~0u, *s, step);
        }
      }
    }
    sum.pushed = __any_sync(~0u, sum.pushed) != 0 ? 1 : 0;
    if (lane == 0) result[c] = sum;
  }
}

/// By a block of threads.
template <class T>
__device__ __forceinline__ void copy_words(const T* from, T* to, int count) {
  const int words = count * static_cast<int>(sizeof(T) / 4);
  for (int i = static_cast<int>(threadIdx.x); i < words; i += static_cast<int>(blockDim.x)) {
    reinterpret_cast<std::int32_t*>(to)[i] = reinterpret_cast<const std::int32_t*>(from)[i];
  }
}

/// That a block of threads may have beside what push_out_of_tips() does.
std::size_t most_shared_bytes() {
  static const int most = [] {
    int bytes = 0;
    check_cuda(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0),
               "be asked");
    return bytes;
  }();
  return static_cast<std::size_t>(most) - 16;
}

template <class Kind>
__device__ __forceinline__ void forget_multipliers(const CudaPbdSet<Kind>& set) {
  if (set.colours == 0) return;
  const int count = set.begin[set.colours] * (ConstraintSet<Kind>::kMultipliers * kLanes);
  for (int i = static_cast<int>(threadIdx.x); i < count; i += static_cast<int>(blockDim.x)) {
    set.multipliers[i] = 0;
  }
}

/// What of a set is in shared memory: where colours begin, and the constraints of the tail, colours
/// of which one warp takes one after the other, for waiting for other warps and for memory would
/// take longer.
template <class Kind>
struct Staged {
  const std::int32_t* begin;
  const ConstraintBlock<Kind>* tail;
};

template <class Kind>
__host__ __device__ int staged_words(const CudaPbdSet<Kind>& set) {
  const int begin = (set.colours + 1 + 3) / 4 * 4;
  return begin + set.tail_blocks * static_cast<int>(sizeof(ConstraintBlock<Kind>) / 4);
}

/// Copies to `words`, and moves it on.
template <class Kind>
__device__ __forceinline__ Staged<Kind> stage(const CudaPbdSet<Kind>& set, std::int32_t*& words) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const int tail = (set.colours + 1 + 3) / 4 * 4;
  for (int i = thread; i <= set.colours; i += threads) words[i] = set.begin[i];
  if (set.tail_blocks > 0) {
    const auto* from = reinterpret_cast<const std::int32_t*>(set.blocks + set.begin[set.tail]);
    const int count = set.tail_blocks * static_cast<int>(sizeof(ConstraintBlock<Kind>) / 4);
    for (int i = thread; i < count; i += threads) words[tail + i] = from[i];
  }
  const Staged<Kind> staged = {words, reinterpret_cast<const ConstraintBlock<Kind>*>(words + tail)};
  words += staged_words(set);
  return staged;
}

template <class Kind, bool kKeep>
__device__ __forceinline__ void project_tail(const CudaPbdSet<Kind>& set,
                                             const Staged<Kind>& staged, bool backward,
                                             float inverse_h2, const float4* x, float4* moved) {
  if (set.tail >= set.colours) return;
  if (threadIdx.x < 32) {
    const int first = staged.begin[set.tail] * kLanes;
    int colour = backward ? set.colours - 1 : set.tail;
    for (int left = set.colours - set.tail; left > 0; --left, colour += backward ? -1 : 1) {
      const int item = staged.begin[colour] * kLanes + static_cast<int>(threadIdx.x);
      if (item < staged.begin[colour + 1] * kLanes) {
        project_item<Kind, kKeep>(load_staged(staged.tail, item - first), inverse_h2, x, moved,
                                  set.multipliers, item);
      }
      __syncwarp();
    }
  }
  __syncthreads();
}

template <class Kind, bool kKeep, int kRounds>
__device__ __forceinline__ void project_set(const CudaPbdSet<Kind>& set, const Staged<Kind>& staged,
                                            bool backward, float inverse_h2, const float4* x,
                                            float4* moved) {
  CudaPbdSet<Kind> of = set;
  of.begin = staged.begin;
  if (backward) project_tail<Kind, kKeep>(set, staged, true, inverse_h2, x, moved);
  project_colours<Kind, kKeep, kRounds>(of, 0, set.tail, backward, inverse_h2, x, moved);
  if (!backward) project_tail<Kind, kKeep>(set, staged, false, inverse_h2, x, moved);
}

/// Threads of a block: tetrahedra take twice the registers.
template <bool kTets>
constexpr int kThreads = kTets ? 512 : 1024;

template <bool kTets, bool kKeep, bool kShared, bool kTips>
__global__ void __launch_bounds__(kThreads<kTets>, 1)
    pbd_steps(CudaPbdField f, CudaPbdFrame frame, int steps, CudaPbdExchange exchange) {
  extern __shared__ float4 places[];
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  float4* const moved = places + f.count + 4 * kLanes;
  for (int i = thread; i < f.count + 4 * kLanes; i += threads) {
    places[i] = f.x[i];
    moved[i] = f.moved[i];
  }
  auto* words = reinterpret_cast<std::int32_t*>(moved + f.count + 4 * kLanes);
  const Staged<Distance> links = stage(f.links, words);
  const Staged<Bending> bends = stage(f.bends, words);
  const Staged<Elastic> elastics = stage(f.elastics, words);
  const Staged<Strain> strains = stage(f.strains, words);
  const int of_steps = steps * frame.colliders;
  float4* const v = f.v;
  if (kShared) {  // what a step reads of each vertex and of colliders lies at hand, too
    f.v = reinterpret_cast<float4*>(words);
    f.predicted = f.v + f.count;
    f.colliders = reinterpret_cast<CudaPbdCollider*>(f.predicted + f.count);
    for (int i = thread; i < f.count; i += threads) f.v[i] = v[i];
  }
  copy_words(exchange.colliders, f.colliders, of_steps);
  for (int i = thread; i < of_steps * kPbdLoadSums; i += threads) f.loads[i] = 0;
  for (int i = thread; i < f.count; i += threads) f.pushed[i] = 0;
  __syncthreads();
  sum_flights(f, exchange.chunks, places, exchange.flights);
  __syncthreads();
  const StepNumbers& step = frame.step;
  const float inverse_h2 = step.inverse_h2;
  for (int s = 0; s < steps; ++s) {
    if (kKeep) {
      if (kTets) forget_multipliers(f.elastics);
      forget_multipliers(f.links);
      forget_multipliers(f.bends);
    }
    for (int i = thread; i < f.count; i += threads)
      predict_vertex(f, step, i, places[i], moved + i);
    __syncthreads();
    for (int sweep = 0; sweep < f.sweeps; ++sweep) {
      const bool backward = kKeep && sweep % 2 == 1;  // a step of one sweep has none
      if (backward) {
        project_set<Bending, kKeep, 1>(f.bends, bends, true, inverse_h2, places, moved);
        project_set<Distance, kKeep, 2>(f.links, links, true, inverse_h2, places, moved);
      }
      if (kTets) {
        if (backward)
          project_set<Strain, false, 1>(f.strains, strains, true, inverse_h2, places, moved);
        project_set<Elastic, kKeep, 1>(f.elastics, elastics, backward, inverse_h2, places, moved);
        if (!backward)
          project_set<Strain, false, 1>(f.strains, strains, false, inverse_h2, places, moved);
      }
      if (!backward) {
        project_set<Distance, kKeep, 2>(f.links, links, false, inverse_h2, places, moved);
        project_set<Bending, kKeep, 1>(f.bends, bends, false, inverse_h2, places, moved);
      }
    }
    project_colours<Touch, false>(f.touches, 0, frame.touch_colours, false, inverse_h2, places,
                                  moved);
    const std::size_t first = static_cast<std::size_t>(s) * frame.colliders;
    for (int i = thread; i < f.count; i += threads) {
      touch_vertex(f, step.h, f.colliders + first, frame.colliders, f.loads + first * kPbdLoadSums,
                   i, places[i], moved + i);
    }
    __syncthreads();
    if (kTips) {
      push_out_of_tips(f.tips, frame.near_tips, f.predicted, f.v, f.pushed, step.h,
                       f.colliders + first, f.loads + first * kPbdLoadSums, places, moved);
    }
    for (int i = thread; i < f.count; i += threads) {
      take_velocity_of(f, step, i, places + i, moved + i);
    }
  }
  for (int i = thread; i < f.count; i += threads) {
    f.x[i] = places[i];
    f.moved[i] = moved[i];
  }
  __syncthreads();
  if (kShared) {
    for (int i = thread; i < f.count; i += threads) v[i] = f.v[i];
  }
  copy_words(f.loads, exchange.loads, of_steps * kPbdLoadSums);
  sum_flights(f, exchange.chunks, places, exchange.flights + exchange.chunks.count);
}

std::size_t shared_bytes(const CudaPbdField& field) {
  const int words = staged_words(field.links) + staged_words(field.bends) +
                    staged_words(field.elastics) + staged_words(field.strains);
  return 2 * (static_cast<std::size_t>(field.count) + 4 * kLanes) * sizeof(float4) +
         static_cast<std::size_t>(words) * 4;
}

/// Of velocities, of where vertices would be, and of colliders.
std::size_t motion_bytes(const CudaPbdField& field, const CudaPbdFrame& frame, int steps) {
  return 2 * static_cast<std::size_t>(field.count) * sizeof(float4) +
         static_cast<std::size_t>(steps) * frame.colliders * sizeof(CudaPbdCollider);
}

template <bool kTets, bool kKeep, bool kShared, bool kTips>
void launch_with(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                 const CudaPbdExchange& exchange, std::size_t bytes, cudaStream_t stream) {
  check_cuda(
      cudaFuncSetAttribute(pbd_steps<kTets, kKeep, kShared, kTips>,
                           cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes)),
      "set shared memory apart");
  pbd_steps<kTets, kKeep, kShared, kTips>
      <<<1, kThreads<kTets>, bytes, stream>>>(field, frame, steps, exchange);
  check_cuda(cudaGetLastError(), "take the steps of a frame");
}

template <bool kTets, bool kKeep, bool kTips>
void launch(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
            const CudaPbdExchange& exchange, cudaStream_t stream) {
  const std::size_t least = shared_bytes(field), all = least + motion_bytes(field, frame, steps);
  if (all <= most_shared_bytes()) {
    launch_with<kTets, kKeep, true, kTips>(field, frame, steps, exchange, all, stream);
  } else {
    launch_with<kTets, kKeep, false, kTips>(field, frame, steps, exchange, least, stream);
  }
}

}  // namespace

bool fits_pbd_block(const CudaPbdField& field) {
  return shared_bytes(field) <= most_shared_bytes();
}

void launch_pbd_steps(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                      const CudaPbdExchange& exchange, cudaStream_t stream) {
  const bool tets = field.elastics.colours + field.strains.colours > 0, keep = field.sweeps > 1;
  // Of tips apart: even where none is near, what is done at them takes registers from each step.
  const auto launch_of = frame.near_tips > 0
                             ? tets   ? keep ? launch<true, true, true> : launch<true, false, true>
                                 : keep ? launch<false, true, true>
                                      : launch<false, false, true>
                         : tets ? keep ? launch<true, true, false> : launch<true, false, false>
                         : keep ? launch<false, true, false>
                                : launch<false, false, false>;
  launch_of(field, frame, steps, exchange, stream);
}

}  // namespace pbd
}  // namespace tissue_sim
