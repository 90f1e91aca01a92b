// All steps of a frame by one block of threads: for tissue of few constraints, where what takes the
// time is to wait between colours. Within a block of threads that is a hundredth of a launch, and
// places are in its shared memory. Where the GPU knows clusters of blocks that share their memories
// (compute capability 9), each of a cluster has a part of the vertices and takes the constraints of
// them: only those across read another one's memory.
#include <cuda_runtime.h>

#include <algorithm>
#include <cstdlib>
#include <type_traits>

#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {
namespace {

template <class Kind>
__device__ __forceinline__ void forget_multipliers(const CudaPbdSet<Kind>& set) {
  if (set.colours == 0) return;
  const int count = set.first[set.colours * set.parts] * ConstraintSet<Kind>::kMultipliers;
  const int threads = static_cast<int>(gridDim.x * blockDim.x);
  for (int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x); i < count; i += threads) {
    set.multipliers[i] = 0;
  }
}

/// What of a set is in shared memory: where colours begin, and the constraints of the tail, colours
/// of which one warp takes one after the other, for waiting for other warps and for memory would
/// take longer.
template <class Kind>
struct Staged {
  const std::int32_t* first;
  const ConstraintBlock<Kind>* tail;
};

template <class Kind>
__host__ __device__ int staged_words(const CudaPbdSet<Kind>& set) {
  const int first = (set.colours * set.parts + 1 + 3) / 4 * 4;
  return first + set.tail_blocks * static_cast<int>(sizeof(ConstraintBlock<Kind>) / 4);
}

/// Copies to `words`, and moves it on.
template <class Kind>
__device__ __forceinline__ Staged<Kind> stage(const CudaPbdSet<Kind>& set, std::int32_t*& words) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const int tail = (set.colours * set.parts + 1 + 3) / 4 * 4;
  for (int i = thread; i <= set.colours * set.parts; i += threads) words[i] = set.first[i];
  if (set.tail_blocks > 0) {
    const auto* from = reinterpret_cast<const std::int32_t*>(
        set.blocks + set.first[set.tail * set.parts] / kLanes);
    const int count = set.tail_blocks * static_cast<int>(sizeof(ConstraintBlock<Kind>) / 4);
    for (int i = thread; i < count; i += threads) words[tail + i] = from[i];
  }
  const Staged<Kind> staged = {words, reinterpret_cast<const ConstraintBlock<Kind>*>(words + tail)};
  words += staged_words(set);
  return staged;
}

template <class Kind, bool kKeep, class At>
__device__ __forceinline__ void project_tail(const CudaPbdSet<Kind>& set, bool backward,
                                             const ConstraintBlock<Kind>* tail, float inverse_h2,
                                             const At& x) {
  if (set.tail >= set.colours) return;
  if (blockIdx.x == 0 && threadIdx.x < 32) {
    const int first = set.first[set.tail * set.parts];
    int colour = backward ? set.colours - 1 : set.tail;
    for (int left = set.colours - set.tail; left > 0; --left, colour += backward ? -1 : 1) {
      const int item = set.first[colour * set.parts] + static_cast<int>(threadIdx.x);
      if (item < set.first[(colour + 1) * set.parts]) {
        project_item<Kind, kKeep>(load_staged(tail, item - first), inverse_h2, x, set.multipliers,
                                  item);
      }
      __syncwarp();
    }
  }
  At::wait();
}

template <class Kind, bool kKeep, int kRounds, class At>
__device__ __forceinline__ void project_set(const CudaPbdSet<Kind>& set, const Staged<Kind>& staged,
                                            bool backward, float inverse_h2, const At& x) {
  CudaPbdSet<Kind> of = set;
  of.first = staged.first;
  if (backward) project_tail<Kind, kKeep>(of, true, staged.tail, inverse_h2, x);
  project_colours<Kind, kKeep, kRounds>(of, 0, set.tail, backward, inverse_h2, x);
  if (!backward) project_tail<Kind, kKeep>(of, false, staged.tail, inverse_h2, x);
}

/// A chunk for each warp, in a fixed order.
__device__ __forceinline__ void sum_flights(const CudaPbdField& f, const CudaPbdFlights& flights,
                                            CudaPbdFlight* result) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  for (int c = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x) / 32; c < flights.count;
       c += static_cast<int>(gridDim.x * blockDim.x) / 32) {
    const CudaPbdChunk chunk = flights.chunks[c];
    const float4 origin = f.x[chunk.first];
    CudaPbdFlight sum = {{origin.x, origin.y, origin.z}, {}, {}, {}, {}, 0};
    for (int k = chunk.begin + lane; k < chunk.end; k += 32) {
      const int i = flights.order[k];
      add_to_flight(f.x[i], f.v[i], f.mass[i], f.pushed[i], sum);
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

template <class T>
__device__ __forceinline__ void copy_words(const T* from, T* to, int count) {
  const int words = count * static_cast<int>(sizeof(T) / 4);
  for (int i = static_cast<int>(threadIdx.x); i < words; i += static_cast<int>(blockDim.x)) {
    reinterpret_cast<std::int32_t*>(to)[i] = reinterpret_cast<const std::int32_t*>(from)[i];
  }
}

/// Threads of a block at most: tetrahedra take twice the registers. Of a cluster's each has fewer
/// constraints.
template <bool kTets, class At>
constexpr int kThreads = kTets || !std::is_same<At, Places>::value ? 512 : 1024;

/// Where this block's vertices, from `begin` on, and all others are.
__device__ __forceinline__ void find(float4* places, int, int, Places& x) { x.x = places; }
__device__ __forceinline__ void find(float4* places, int share, int begin, ClusterPlaces& x) {
#if __CUDA_ARCH__ >= 900
  const auto own = static_cast<std::uint32_t>(__cvta_generic_to_shared(places));
  std::uint32_t second;
  asm("mapa.shared::cluster.u32 %0, %1, 0;" : "=r"(x.first) : "r"(own));
  asm("mapa.shared::cluster.u32 %0, %1, 1;" : "=r"(second) : "r"(own));
  x.beyond = second - x.first - 16u * static_cast<std::uint32_t>(share);
  x.magic = ~0u / static_cast<std::uint32_t>(share) + 1;
#endif
}

template <bool kTets, bool kKeep, bool kShared, class At>
__global__ void __launch_bounds__(kThreads<kTets, At>, 1)
    pbd_steps(CudaPbdField f, CudaPbdFrame frame, int steps, CudaPbdExchange exchange) {
  extern __shared__ float4 memory[];
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const int share = vertices_of_part(f.count, f.parts), begin = At::part() * share;
  const int end = min(f.count, begin + share), padded = min(f.count + 4 * kLanes, begin + share);
  float4* const own = memory - begin;  // by a vertex's index
  At x;
  find(memory, share, begin, x);
  for (int i = begin + thread; i < padded; i += threads) own[i] = f.x[i];
  auto* words = reinterpret_cast<std::int32_t*>(memory + share);
  const Staged<Distance> links = stage(f.links, words);
  const Staged<Bending> bends = stage(f.bends, words);
  const Staged<Elastic> elastics = stage(f.elastics, words);
  const Staged<Strain> strains = stage(f.strains, words);
  const int of_steps = steps * frame.colliders;
  const CudaPbdField kept = f;
  if (kShared) {  // what a step reads of each vertex and of colliders lies at hand, too
    f.v = reinterpret_cast<float4*>(words) - begin;
    f.predicted = f.v + share;
    f.colliders = reinterpret_cast<CudaPbdCollider*>(f.predicted + begin + share);
    for (int i = begin + thread; i < end; i += threads) f.v[i] = kept.v[i];
  }
  if (kShared || blockIdx.x == 0) copy_words(exchange.colliders, f.colliders, of_steps);
  if (blockIdx.x == 0) {
    for (int i = thread; i < of_steps * kPbdLoadSums; i += threads) f.loads[i] = 0;
  }
  for (int i = begin + thread; i < end; i += threads) f.pushed[i] = 0;
  At::wait();
  sum_flights(kept, exchange.chunks, exchange.flights);
  At::wait();
  const StepNumbers& step = frame.step;
  const float inverse_h2 = step.inverse_h2;
  for (int s = 0; s < steps; ++s) {
    if (kKeep) {
      if (kTets) forget_multipliers(f.elastics);
      forget_multipliers(f.links);
      forget_multipliers(f.bends);
    }
    for (int i = begin + thread; i < end; i += threads) predict_vertex(f, step, i, own + i);
    At::wait();
    for (int sweep = 0; sweep < f.sweeps; ++sweep) {
      const bool backward = kKeep && sweep % 2 == 1;  // a step of one sweep has none
      if (backward) {
        project_set<Bending, kKeep, 1>(f.bends, bends, true, inverse_h2, x);
        project_set<Distance, kKeep, 2>(f.links, links, true, inverse_h2, x);
      }
      if (kTets) {
        if (backward) project_set<Strain, false, 1>(f.strains, strains, true, inverse_h2, x);
        project_set<Elastic, kKeep, 1>(f.elastics, elastics, backward, inverse_h2, x);
        if (!backward) project_set<Strain, false, 1>(f.strains, strains, false, inverse_h2, x);
      }
      if (!backward) {
        project_set<Distance, kKeep, 2>(f.links, links, false, inverse_h2, x);
        project_set<Bending, kKeep, 1>(f.bends, bends, false, inverse_h2, x);
      }
    }
    project_colours<Touch, false>(f.touches, 0, frame.touch_colours, false, inverse_h2, x);
    // From here to the next step's projections each block looks at its own vertices alone.
    const std::size_t first = static_cast<std::size_t>(s) * frame.colliders;
    for (int i = begin + thread; i < end; i += threads) {
      touch_vertex(f, step.h, f.colliders + first, frame.colliders, f.loads + first * kPbdLoadSums,
                   i, own + i);
      take_velocity_of(f, step, i, own[i]);
    }
  }
  for (int i = begin + thread; i < end; i += threads) {
    kept.x[i] = own[i];
    if (kShared) {
      kept.v[i] = f.v[i];
      kept.predicted[i] = f.predicted[i];
    }
  }
  At::wait();  // nor does a block leave while another one reads what it has
  if (blockIdx.x == 0) copy_words(f.loads, exchange.loads, of_steps * kPbdLoadSums);
  sum_flights(kept, exchange.chunks, exchange.flights + exchange.chunks.count);
}

std::size_t shared_bytes(const CudaPbdField& field) {
  const int words = staged_words(field.links) + staged_words(field.bends) +
                    staged_words(field.elastics) + staged_words(field.strains);
  return static_cast<std::size_t>(vertices_of_part(field.count, field.parts)) * sizeof(float4) +
         static_cast<std::size_t>(words) * 4;
}

/// Of velocities, of where vertices would be, and of colliders.
std::size_t motion_bytes(const CudaPbdField& field, std::size_t colliders) {
  return 2 * static_cast<std::size_t>(vertices_of_part(field.count, field.parts)) * sizeof(float4) +
         colliders * sizeof(CudaPbdCollider);
}

std::size_t most_shared_bytes() {
  static const int most = [] {
    int bytes = 0;
    check_cuda(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0),
               "be asked");
    return bytes;
  }();
  return static_cast<std::size_t>(most);
}

template <bool kTets, bool kKeep, bool kShared>
void launch_one(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                const CudaPbdExchange& exchange, std::size_t bytes, cudaStream_t stream) {
  const auto kernel = pbd_steps<kTets, kKeep, kShared, Places>;
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                  static_cast<int>(bytes)),
             "set shared memory apart");
  kernel<<<1, kThreads<kTets, Places>, bytes, stream>>>(field, frame, steps, exchange);
}

#if CUDART_VERSION >= 11080
/// A thread for each constraint of a part, as far as a block may have them.
template <bool kTets>
int threads_of(const CudaPbdField& f) {
  const int most = std::max({f.links.most, f.bends.most, f.elastics.most, f.strains.most, 128});
  return std::min((most + 31) / 32 * 32, kThreads<kTets, ClusterPlaces>);
}

template <class Kernel, class... Arguments>
void launch_cluster(Kernel kernel, int blocks, int threads, std::size_t bytes, cudaStream_t stream,
                    const Arguments&... arguments) {
  check_cuda(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                  static_cast<int>(bytes)),
             "set shared memory apart");
  cudaLaunchAttribute cluster{};
  cluster.id = cudaLaunchAttributeClusterDimension;
  cluster.val.clusterDim.x = static_cast<unsigned>(blocks);
  cluster.val.clusterDim.y = cluster.val.clusterDim.z = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = static_cast<unsigned>(blocks);
  config.blockDim = static_cast<unsigned>(threads);
  config.dynamicSmemBytes = bytes;
  config.stream = stream;
  config.attrs = &cluster;
  config.numAttrs = 1;
  check_cuda(cudaLaunchKernelEx(&config, kernel, arguments...), "take the steps of a frame");
}

/// Whether the blocks' memories lie at even distances in the cluster's window of addresses.
__global__ void pbd_even_windows(int* even) {
#if __CUDA_ARCH__ >= 900
  extern __shared__ float4 memory[];
  const auto own = static_cast<std::uint32_t>(__cvta_generic_to_shared(memory));
  std::uint32_t at[2], next;
  asm("mapa.shared::cluster.u32 %0, %1, 0;" : "=r"(at[0]) : "r"(own));
  asm("mapa.shared::cluster.u32 %0, %1, 1;" : "=r"(at[1]) : "r"(own));
  asm("mapa.shared::cluster.u32 %0, %1, %2;" : "=r"(next) : "r"(own), "r"(blockIdx.x));
  if (threadIdx.x == 0) even[blockIdx.x] = next == at[0] + blockIdx.x * (at[1] - at[0]) ? 1 : 0;
#else
  if (threadIdx.x == 0) even[blockIdx.x] = 0;
#endif
}

/// What pbd_cluster_blocks() says.
int find_cluster() {
  const char* asked = std::getenv("TISSUE_SIM_PBD_BLOCKS");
  const int kBlocks = asked ? std::atoi(asked) : 4;
  int major = 0;
  cudaFuncAttributes code{};
  check_cuda(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0), "be asked");
  check_cuda(cudaFuncGetAttributes(&code, pbd_even_windows), "be asked");
  if (major < 9 || code.ptxVersion < 90) return 1;  // or its code is an older GPU's
  DeviceArray<int> even;
  even.resize(kBlocks);
  launch_cluster(pbd_even_windows, kBlocks, 32, 16, nullptr, even.data());
  int host[16];
  even.download(host, kBlocks, nullptr);
  check_cuda(cudaStreamSynchronize(nullptr), "be asked");
  return std::count(host, host + kBlocks, 1) == kBlocks ? kBlocks : 1;
}
#endif

template <bool kTets, bool kKeep>
void launch(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
            const CudaPbdExchange& exchange, cudaStream_t stream) {
  const std::size_t least = shared_bytes(field);
  const std::size_t all =
      least + motion_bytes(field, static_cast<std::size_t>(steps) * frame.colliders);
#if CUDART_VERSION >= 11080
  if (field.parts > 1) {
    return launch_cluster(pbd_steps<kTets, kKeep, true, ClusterPlaces>, field.parts,
                          threads_of<kTets>(field), all, stream, field, frame, steps, exchange);
  }
#endif
  if (all <= most_shared_bytes()) {
    launch_one<kTets, kKeep, true>(field, frame, steps, exchange, all, stream);
  } else {
    launch_one<kTets, kKeep, false>(field, frame, steps, exchange, least, stream);
  }
  check_cuda(cudaGetLastError(), "take the steps of a frame");
}

}  // namespace

int pbd_cluster_blocks() {
#if CUDART_VERSION >= 11080
  static const int blocks = find_cluster();
  return blocks;
#else
  return 1;
#endif
}

bool fits_pbd_blocks(CudaPbdField field, int parts, std::size_t colliders) {
  field.parts = field.links.parts = field.bends.parts = parts;
  field.elastics.parts = field.strains.parts = parts;
  const std::size_t bytes = shared_bytes(field);
  return (parts > 1 ? bytes + motion_bytes(field, colliders) : bytes) <= most_shared_bytes();
}

void launch_pbd_steps(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                      const CudaPbdExchange& exchange, cudaStream_t stream) {
  const bool tets = field.elastics.colours + field.strains.colours > 0;
  if (field.sweeps > 1) {
    tets ? launch<true, true>(field, frame, steps, exchange, stream)
         : launch<false, true>(field, frame, steps, exchange, stream);
  } else {
    tets ? launch<true, false>(field, frame, steps, exchange, stream)
         : launch<false, false>(field, frame, steps, exchange, stream);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
