// Steps by launches: for tissue of many constraints. A launch is a colour, so its end is the
// barrier that the next colour needs; small colours that follow one another share a launch of one
// block of threads.
#include <thrust/iterator/counting_iterator.h>

#include <algorithm>
#include <cub/device/device_select.cuh>
#include <utility>
#include <vector>

#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kThreads = 128;
constexpr int kThreadsOfFew = 512;
constexpr int kFewBlocks = kThreadsOfFew / kLanes;  ///< of constraints: one for each thread

template <class Kind, bool kKeep>
__global__ void __launch_bounds__(kThreads)
    pbd_project_colour(const ConstraintBlock<Kind>* blocks, int count, float* multipliers,
                       const CudaPbdFrame* frame, const float4* x, float4* moved) {
  const int item = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (item >= count * kLanes) return;
  const float inverse_h2 = frame->step.inverse_h2;
  project_item<Kind, kKeep>(load_item(blocks, item), inverse_h2, x, moved, multipliers, item);
}

template <class Kind, bool kKeep>
__global__ void __launch_bounds__(kThreadsOfFew)
    pbd_project_few(CudaPbdSet<Kind> set, int first, int last, bool backward,
                    const CudaPbdFrame* frame, const float4* x, float4* moved) {
  project_colours<Kind, kKeep>(set, first, last, backward, frame->step.inverse_h2, x, moved);
}

/// All colours of what touches, few as they are, by one block: how many there are is not known when
/// the launch is put into a graph.
__global__ void __launch_bounds__(kThreadsOfFew)
    pbd_project_touches(CudaPbdSet<Touch> set, const CudaPbdFrame* frame, const float4* x,
                        float4* moved) {
  project_colours<Touch, false>(set, 0, frame->touch_colours, false, frame->step.inverse_h2, x,
                                moved);
}

__global__ void __launch_bounds__(kThreads) pbd_predict(CudaPbdField f) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < f.count) predict_vertex(f, f.frame->step, i, f.x[i], f.moved + i);
}

__global__ void __launch_bounds__(kThreads) pbd_touch(CudaPbdField f) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= f.count) return;
  const int count = f.frame->colliders, step = *f.step;
  touch_vertex(f, f.frame->step.h, f.colliders + static_cast<std::size_t>(step) * count, count,
               f.loads + static_cast<std::size_t>(step) * count * kPbdLoadSums, i, f.x[i],
               f.moved + i);
}

__global__ void __launch_bounds__(kThreadsOfFew) pbd_touch_tips(CudaPbdField f) {
  const std::size_t first = static_cast<std::size_t>(*f.step) * f.frame->colliders;
  push_out_of_tips(f.tips, f.frame->near_tips, f.predicted, f.v, f.pushed, f.frame->step.h,
                   f.colliders + first, f.loads + first * kPbdLoadSums, f.x, f.moved);
}

/// Whether the triangle of a number of CudaPbdTips comes near its tip.
struct IsNearTip {
  CudaPbdField f;
  double duration;
  __device__ bool operator()(std::int32_t pair) const {
    Corner corner[3];
    load_corners(f.tips.triangles[pair % f.tips.count], f.x, f.moved, f.predicted, f.v, corner);
    return may_meet(f.tips.sweeps[pair / f.tips.count], corner, f.tips.mean_edge, duration);
  }
};

__global__ void __launch_bounds__(kThreads) pbd_take_velocities(CudaPbdField f) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i == 0) *f.step += 1;
  if (i < f.count) take_velocity_of(f, f.frame->step, i, f.x + i, f.moved + i);
}

/// Calls of(first, last) with the colours of each launch, or `backward`.
template <class F>
void each_launch(const std::vector<std::int32_t>& begin, bool backward, const F& of) {
  const int colours = static_cast<int>(begin.size()) - 1;
  std::vector<std::pair<int, int>> launches;
  for (int first = 0; first < colours;) {
    int last = first + 1;
    if (begin[last] - begin[first] <= kFewBlocks) {
      while (last < colours && begin[last + 1] - begin[last] <= kFewBlocks) ++last;
    }
    launches.emplace_back(first, last);
    first = last;
  }
  if (backward) std::reverse(launches.begin(), launches.end());
  for (const auto& l : launches) of(l.first, l.second);
}

template <class Kind, bool kKeep>
void launch_set(const CudaPbdField& field, const CudaPbdSet<Kind>& set,
                const std::vector<std::int32_t>& begin, bool backward, cudaStream_t stream) {
  each_launch(begin, backward, [&](int first, int last) {
    const int count = begin[first + 1] - begin[first];
    if (count <= kFewBlocks) {
      pbd_project_few<Kind, kKeep><<<1, kThreadsOfFew, 0, stream>>>(
          set, first, last, backward, field.frame, field.x, field.moved);
    } else {
      const int blocks = (count * kLanes + kThreads - 1) / kThreads;
      float* multipliers = set.multipliers + static_cast<std::ptrdiff_t>(begin[first]) *
                                                 (ConstraintSet<Kind>::kMultipliers * kLanes);
      pbd_project_colour<Kind, kKeep><<<blocks, kThreads, 0, stream>>>(
          set.blocks + begin[first], count, multipliers, field.frame, field.x, field.moved);
    }
  });
}

template <bool kKeep>
void launch_sets(const CudaPbdField& f, const CudaPbdColours& colours, bool backward,
                 cudaStream_t stream) {
  const auto tetrahedra = [&](bool elastic) {
    if (elastic) launch_set<Elastic, kKeep>(f, f.elastics, colours.elastics, backward, stream);
    if (!elastic) launch_set<Strain, false>(f, f.strains, colours.strains, backward, stream);
  };
  if (!backward) {
    tetrahedra(true);
    tetrahedra(false);
    launch_set<Distance, kKeep>(f, f.links, colours.links, false, stream);
  }
  launch_set<Bending, kKeep>(f, f.bends, colours.bends, backward, stream);
  if (backward) {
    launch_set<Distance, kKeep>(f, f.links, colours.links, true, stream);
    tetrahedra(false);
    tetrahedra(true);
  }
  check_cuda(cudaGetLastError(), "project constraints");
}

template <class Kind>
void forget(const CudaPbdSet<Kind>& set, const std::vector<std::int32_t>& begin,
            cudaStream_t stream) {
  const std::size_t floats =
      static_cast<std::size_t>(begin.back()) * (ConstraintSet<Kind>::kMultipliers * kLanes);
  if (floats == 0) return;
  check_cuda(cudaMemsetAsync(set.multipliers, 0, floats * sizeof(float), stream), "clear memory");
}

}  // namespace

int pbd_projection_launches(const CudaPbdColours& colours) {
  int count = 0;
  for (const auto* begin : {&colours.elastics, &colours.strains, &colours.links, &colours.bends}) {
    each_launch(*begin, false, [&](int, int) { ++count; });
  }
  return count;
}

void launch_pbd_projections(const CudaPbdField& field, const CudaPbdColours& colours, bool keep,
                            bool backward, cudaStream_t stream) {
  if (keep) {
    launch_sets<true>(field, colours, backward, stream);
  } else {
    launch_sets<false>(field, colours, backward, stream);
  }
}

void launch_pbd_dampers(const CudaPbdField& field, const std::vector<std::int32_t>& begin,
                        cudaStream_t stream) {
  CudaPbdField of_velocities = field;
  of_velocities.moved = field.v;
  launch_set<Damper, false>(of_velocities, field.dampers, begin, false, stream);
  check_cuda(cudaGetLastError(), "damp neighbours");
}

void launch_pbd_step(const CudaPbdField& field, const CudaPbdColours& colours,
                     cudaStream_t stream) {
  const int blocks = (field.count + kThreads - 1) / kThreads;
  const bool keep = field.sweeps > 1;
  pbd_predict<<<blocks, kThreads, 0, stream>>>(field);
  if (keep) {
    forget(field.elastics, colours.elastics, stream);
    forget(field.links, colours.links, stream);
    forget(field.bends, colours.bends, stream);
  }
  for (int i = 0; i < field.sweeps; ++i) {
    launch_pbd_projections(field, colours, keep, i % 2 == 1, stream);
  }
  if (field.may_touch) {
    pbd_project_touches<<<1, kThreadsOfFew, 0, stream>>>(field.touches, field.frame, field.x,
                                                         field.moved);
  }
  pbd_touch<<<blocks, kThreads, 0, stream>>>(field);
  if (field.tips.count > 0) pbd_touch_tips<<<1, kThreadsOfFew, 0, stream>>>(field);
  pbd_take_velocities<<<blocks, kThreads, 0, stream>>>(field);
  check_cuda(cudaGetLastError(), "take a step");
}

void launch_pbd_near_tips(const CudaPbdField& field, int sweeps, double duration, int* count,
                          void* memory, std::size_t& bytes, cudaStream_t stream) {
  check_cuda(cub::DeviceSelect::If(memory, bytes, thrust::counting_iterator<std::int32_t>(0),
                                   field.tips.near, count, sweeps * field.tips.count,
                                   IsNearTip{field, duration}, stream),
             "find what comes near tips");
}

}  // namespace pbd
}  // namespace tissue_sim
