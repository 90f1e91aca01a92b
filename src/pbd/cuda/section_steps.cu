// All steps of a frame by a cluster of blocks of threads, one for each section (pbd/sections.h):
// each has its constraints and places in its shared memory, and writes what another one needs next
// into that one's. So blocks wait for one another three times a step, not at each colour, and what
// a thread waits for between passes is its own block.
#include "pbd/cuda/block_of_threads.h"
#include "pbd/cuda/cluster.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kThreads = 384;
constexpr std::size_t kMailboxes = 32;  ///< bytes at most

/// Shared memory of a block: all places, of which it keeps up those that are its in a phase; its
/// words; and of the vertices of its section velocities, where they would be, masses, whether they
/// were pushed.
struct Layout {
  int count, words, own;
  __host__ __device__ std::size_t bytes(int colliders) const {
    return static_cast<std::size_t>(count) * sizeof(float4) + static_cast<std::size_t>(words) * 4 +
           static_cast<std::size_t>((own + 1) / 2 * 2) * (2 * sizeof(float4) + sizeof(double)) +
           colliders * sizeof(CudaPbdCollider) + (own + 3) / 4 * 4;
  }
};

#if CUDART_VERSION >= 11080
template <class Kind>
__device__ __forceinline__ Item<Kind> unpack(const int4& packed) {
  Item<Kind> item;
#pragma unroll
  for (int i = 0; i < Kind::kVertices; ++i) {
    const auto two = static_cast<unsigned>(i < 2 ? packed.x : packed.y);
    item.vertex[i] = static_cast<std::int32_t>(i % 2 == 0 ? two & 0xffffu : two >> 16);
  }
  item.number[0] = __int_as_float(packed.z);
  item.number[1] = __int_as_float(packed.w);
  return item;
}

/// Leaves the block's threads in step. What a thread takes first of the next pass is read while it
/// projects, and where the pass after that begins, so that after waiting it reads places alone.
template <class Kind>
__device__ __forceinline__ void project_passes(const std::int32_t* begin, int first, int last,
                                               const int4* items, float inverse_h2, float4* x) {
  if (first >= last) return;
  const int thread = static_cast<int>(threadIdx.x);
  int item = begin[first] + thread, end = begin[first + 1];
  int next = end + thread, next_end = first + 1 < last ? begin[first + 2] : end;
  int4 packed = {};
  if (item < end) packed = items[item];
  Item<Kind> now = unpack<Kind>(packed);
  for (int pass = first; pass < last; ++pass) {
    if (next < next_end) packed = items[next];
    const int after = pass + 2 < last ? begin[pass + 3] : next_end;
    if (item < end) {
      project_item<Kind, false>(now, inverse_h2, x, nullptr, 0);
      for (item += kThreads; item < end; item += kThreads) {
        project_item<Kind, false>(unpack<Kind>(items[item]), inverse_h2, x, nullptr, 0);
      }
    }
    now = unpack<Kind>(packed);
    item = next;
    end = next_end;
    next = next_end + thread;
    next_end = after;
    __syncthreads();
  }
}

__global__ void __launch_bounds__(kThreads, 1)
    pbd_section_steps([[maybe_unused]] CudaPbdField f, [[maybe_unused]] CudaPbdFrame frame,
                      [[maybe_unused]] int steps, [[maybe_unused]] CudaPbdSections sections,
                      [[maybe_unused]] CudaPbdExchange exchange) {
#if __CUDA_ARCH__ >= 900
  extern __shared__ float4 places[];
  __shared__ Mailbox mailbox[3];  // of each phase's end
  const int thread = static_cast<int>(threadIdx.x), rank = static_cast<int>(blockIdx.x);
  const int of_steps = steps * frame.colliders;
  const CudaPbdSection section = sections.of[rank];
  const int count = section.moves[0] - section.own;
  auto* words = reinterpret_cast<std::int32_t*>(places + f.count);
  const std::int32_t *begin = words, *own = words + section.own;
  const auto* items = reinterpret_cast<const int4*>(words + section.items);
  CudaPbdField mine = f;  // of the section's vertices
  mine.v = reinterpret_cast<float4*>(words + section.words);
  mine.predicted = mine.v + count;
  auto* mass = reinterpret_cast<double*>(mine.predicted + count);
  mine.mass = mass;
  mine.colliders = reinterpret_cast<CudaPbdCollider*>(mass + (count + 1) / 2 * 2);
  mine.pushed = reinterpret_cast<std::uint8_t*>(mine.colliders + of_steps);

  for (int i = thread; i < f.count; i += kThreads) places[i] = f.x[i];
  copy_words(reinterpret_cast<const int4*>(sections.words + section.begin),
             reinterpret_cast<int4*>(words), section.words / 4);
  copy_words(exchange.colliders, mine.colliders, of_steps);
  if (rank == 0) {
    for (int i = thread; i < of_steps * kPbdLoadSums; i += kThreads) f.loads[i] = 0;
  }
  sum_flights(f, exchange.chunks, f.x, rank, sections.count, exchange.flights);
  __syncthreads();
  for (int i = thread; i < count; i += kThreads) {
    mine.v[i] = f.v[own[i]];
    mass[i] = f.mass[own[i]];
    mine.pushed[i] = 0;
  }
  if (thread == 0) {
    for (Mailbox& m : mailbox) m.open();
  }
  wait_for_cluster();

  // A vertex is written by who has it in his hands, and who gets it waits for it. So nobody is a
  // step ahead of who sends to him, and no counts mix.
  const auto hand_over = [&](int phase, int s) {
    Mailbox& box = mailbox[phase];
    if (thread == 0) box.expect(section.incoming[phase] * static_cast<int>(sizeof(float4)));
    for (int i = section.moves[phase] + thread; i < section.moves[phase + 1]; i += kThreads) {
      const int vertex = words[i] & 0xffff;
      box.send(places[vertex], places + vertex, words[i] >> 16);
    }
    box.wait(s);
  };
  const int* first = sections.first;
  const StepNumbers& step = frame.step;
  const float inverse_h2 = step.inverse_h2;
  for (int s = 0; s < steps; ++s) {
    for (int i = thread; i < count; i += kThreads) predict_vertex(mine, step, i, places + own[i]);
    __syncthreads();
    project_passes<Distance>(begin, first[0], first[1], items, inverse_h2, places);
    hand_over(0, s);
    project_passes<Distance>(begin, first[1], first[2], items, inverse_h2, places);
    hand_over(1, s);
    project_passes<Distance>(begin, first[2], first[3], items, inverse_h2, places);
    project_passes<Bending>(begin, first[3], first[4], items, inverse_h2, places);
    hand_over(2, s);
    project_passes<Bending>(begin, first[4], first[5], items, inverse_h2, places);
    const std::size_t at = static_cast<std::size_t>(s) * frame.colliders;
    for (int i = thread; i < count; i += kThreads) {  // from here on each thread's own vertices
      touch_vertex(mine, step.h, mine.colliders + at, frame.colliders, f.loads + at * kPbdLoadSums,
                   i, places + own[i]);
      take_velocity_of(mine, step, i, places[own[i]]);
    }
  }
  for (int i = thread; i < count; i += kThreads) {
    f.x[own[i]] = places[own[i]];
    f.v[own[i]] = mine.v[i];
    f.predicted[own[i]] = mine.predicted[i];
    f.pushed[own[i]] = mine.pushed[i];
  }
  wait_for_cluster();
  if (rank == 0) copy_words(f.loads, exchange.loads, of_steps * kPbdLoadSums);
  sum_flights(f, exchange.chunks, f.x, rank, sections.count,
              exchange.flights + exchange.chunks.count);
#endif
}
#endif

}  // namespace

int most_pbd_sections() {
#if CUDART_VERSION >= 11080
  int major = 0;
  check_cuda(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0), "be asked");
  return major >= 9 ? 8 : 0;  // blocks of a cluster on any GPU that has clusters
#else
  return 0;
#endif
}

bool fits_pbd_sections(const CudaPbdField& field, const CudaPbdSections& sections, int colliders) {
  const Layout layout = {field.count, sections.most_words, sections.most_own};
  return field.count < 1 << 16 && layout.bytes(colliders) + kMailboxes <= most_shared_bytes();
}

void launch_pbd_section_steps([[maybe_unused]] const CudaPbdField& field,
                              [[maybe_unused]] const CudaPbdFrame& frame,
                              [[maybe_unused]] int steps,
                              [[maybe_unused]] const CudaPbdSections& sections,
                              [[maybe_unused]] const CudaPbdExchange& exchange,
                              [[maybe_unused]] cudaStream_t stream) {
#if CUDART_VERSION >= 11080
  const Layout layout = {field.count, sections.most_words, sections.most_own};
  cudaLaunchAttribute of_cluster = {};
  of_cluster.id = cudaLaunchAttributeClusterDimension;
  of_cluster.val.clusterDim.x = static_cast<unsigned>(sections.count);
  of_cluster.val.clusterDim.y = of_cluster.val.clusterDim.z = 1;
  cudaLaunchConfig_t config = {};
  config.gridDim = dim3(static_cast<unsigned>(sections.count));
  config.blockDim = dim3(kThreads);
  config.dynamicSmemBytes = layout.bytes(steps * frame.colliders);
  config.stream = stream;
  config.attrs = &of_cluster;
  config.numAttrs = 1;
  check_cuda(cudaFuncSetAttribute(pbd_section_steps, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                  static_cast<int>(config.dynamicSmemBytes)),
             "set shared memory apart");
  check_cuda(
      cudaLaunchKernelEx(&config, pbd_section_steps, field, frame, steps, sections, exchange),
      "take the steps of a frame");
#endif
}

}  // namespace pbd
}  // namespace tissue_sim
