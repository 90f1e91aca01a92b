// A thread's constraint on the GPU, and a vertex's part of a step. For .cu files.
#pragma once

#include "pbd/contact.h"
#include "pbd/cuda/device_state.h"
#include "pbd/project.h"

namespace tissue_sim {
namespace pbd {

/// A constraint read ahead of its turn: it does not depend on where vertices are.
template <class Kind>
struct Item {
  std::int32_t vertex[Kind::kVertices];
  float number[Kind::kNumbers];
};

template <class Kind>
__device__ __forceinline__ Item<Kind> load_item(const ConstraintBlock<Kind>* blocks, int item) {
  const ConstraintBlock<Kind>& block = blocks[item / kLanes];
  const int lane = item % kLanes;
  Item<Kind> result;
#pragma unroll
  for (int i = 0; i < Kind::kVertices; ++i) result.vertex[i] = __ldg(&block.vertex[i][lane]);
#pragma unroll
  for (int i = 0; i < Kind::kNumbers; ++i) result.number[i] = __ldg(&block.number[i][lane]);
  return result;
}

/// From shared memory.
template <class Kind>
__device__ __forceinline__ Item<Kind> load_staged(const ConstraintBlock<Kind>* blocks, int item) {
  const ConstraintBlock<Kind>& block = blocks[item / kLanes];
  const int lane = item % kLanes;
  Item<Kind> result;
#pragma unroll
  for (int i = 0; i < Kind::kVertices; ++i) result.vertex[i] = block.vertex[i][lane];
#pragma unroll
  for (int i = 0; i < Kind::kNumbers; ++i) result.number[i] = block.number[i][lane];
  return result;
}

template <class Kind, bool kKeep>
__device__ __forceinline__ void project_item(const Item<Kind>& item, float inverse_h2,
                                             const float4* x, float4* moved, float* multipliers,
                                             int index) {
  constexpr int kMultipliers = ConstraintSet<Kind>::kMultipliers;
  constexpr bool kKept = kKeep && Kind::kMultipliers > 0;
  Vertex<float> v[Kind::kVertices];
#pragma unroll
  for (int i = 0; i < Kind::kVertices; ++i) {
    const float4 at = x[item.vertex[i]], by = moved[item.vertex[i]];
    v[i] = {at.x, at.y, at.z, at.w, {by.x, by.y, by.z}};
  }
  float lambda[kMultipliers];
  float* kept = multipliers + (index / kLanes) * (kMultipliers * kLanes) + index % kLanes;
#pragma unroll
  for (int i = 0; i < kMultipliers; ++i) lambda[i] = kKept ? kept[i * kLanes] : 0.0f;
  project_kind<Kind, kKeep>(v, item.number, inverse_h2, lambda);
#pragma unroll
  for (int i = 0; i < kMultipliers; ++i) {
    if (kKept) kept[i * kLanes] = lambda[i];
  }
#pragma unroll
  for (int i = 0; i < Kind::kVertices; ++i) {
    moved[item.vertex[i]] = make_float4(v[i].moved.x, v[i].moved.y, v[i].moved.z, 0);
  }
}

/// The colours from `first` to before `last`, or `backward`, by one block of threads, all threads
/// together; leaves them in step. Reads ahead what each thread takes first of the next colour,
/// kRounds times.
template <class Kind, bool kKeep, int kRounds = 1>
__device__ __forceinline__ void project_colours(const CudaPbdSet<Kind>& set, int first, int last,
                                                bool backward, float inverse_h2, const float4* x,
                                                float4* moved) {
  if (first >= last) return;
  const int threads = static_cast<int>(blockDim.x), thread = static_cast<int>(threadIdx.x);
  int colour = backward ? last - 1 : first;
  int item = set.begin[colour] * kLanes + thread, end = set.begin[colour + 1] * kLanes;
  Item<Kind> ahead[kRounds], now[kRounds];
#pragma unroll
  for (int r = 0; r < kRounds; ++r) {
    if (item + r * threads < end) ahead[r] = load_item(set.blocks, item + r * threads);
  }
  for (int left = last - first - 1; left >= 0; --left) {
    int next = thread, next_end = 0;
    if (left > 0) {
      colour += backward ? -1 : 1;
      next = set.begin[colour] * kLanes + thread;
      next_end = set.begin[colour + 1] * kLanes;
    }
#pragma unroll
    for (int r = 0; r < kRounds; ++r) {
      now[r] = ahead[r];
      if (next + r * threads < next_end) ahead[r] = load_item(set.blocks, next + r * threads);
    }
#pragma unroll
    for (int r = 0; r < kRounds; ++r, item += threads) {
      if (item < end)
        project_item<Kind, kKeep>(now[r], inverse_h2, x, moved, set.multipliers, item);
    }
    for (; item < end; item += threads) {
      project_item<Kind, kKeep>(load_item(set.blocks, item), inverse_h2, x, moved, set.multipliers,
                                item);
    }
    __syncthreads();
    item = next;
    end = next_end;
  }
}

/// Adds a vertex of `m` kg to the sums of what it is a part of; places count from sum.origin.
__device__ __forceinline__ void add_to_flight(const float4& x, const float4& v, double m,
                                              std::uint8_t pushed, CudaPbdFlight& sum) {
  const double d[3] = {x.x - sum.origin[0], x.y - sum.origin[1], x.z - sum.origin[2]};
  const double p[3] = {m * v.x, m * v.y, m * v.z};
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    sum.moment[a] += m * d[a];
    sum.linear[a] += p[a];
    sum.angular[a] += d[b] * p[c] - d[c] * p[b];
    sum.second[a] += m * d[a] * d[a];
  }
  sum.second[3] += m * d[0] * d[1];
  sum.second[4] += m * d[0] * d[2];
  sum.second[5] += m * d[1] * d[2];
  sum.pushed |= pushed;
}

__device__ __forceinline__ void predict_vertex(const CudaPbdField& f, const StepNumbers& step,
                                               int i, const float4& place, float4* moved) {
  const float4 m4 = *moved, v4 = f.v[i];
  const float x[4] = {place.x, place.y, place.z, place.w};
  float v[3] = {v4.x, v4.y, v4.z}, m[3] = {m4.x, m4.y, m4.z}, predicted[3];
  predict(step, x, m, predicted, v);
  *moved = make_float4(m[0], m[1], m[2], 0);
  f.predicted[i] = make_float4(predicted[0], predicted[1], predicted[2], 0);
  f.v[i] = make_float4(v[0], v[1], v[2], 0);
}

__device__ __forceinline__ void take_velocity_of(const CudaPbdField& f, const StepNumbers& step,
                                                 int i, float4* place, float4* moved) {
  const float4 x4 = *place, m4 = *moved, p4 = f.predicted[i], v4 = f.v[i];
  const float predicted[3] = {p4.x, p4.y, p4.z};
  float x[3] = {x4.x, x4.y, x4.z}, m[3] = {m4.x, m4.y, m4.z}, v[3] = {v4.x, v4.y, v4.z};
  take_velocity(step, x, m, predicted, v);
  *place = make_float4(x[0], x[1], x[2], x4.w);
  *moved = make_float4(m[0], m[1], m[2], 0);
  f.v[i] = make_float4(v[0], v[1], v[2], 0);
}

__device__ __forceinline__ void add_load(unsigned long long* load, double value) {
  atomicAdd(load, static_cast<unsigned long long>(__double2ll_rn(value * (1 / kPbdLoadUnit))));
}

/// Adds what acts on a tool's collider; nobody asks what the ground carries.
__device__ __forceinline__ void add_push(const Collider& collider, const ContactPush& push,
                                         bool counts, unsigned long long* load) {
  if (collider.tool < 0) return;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    add_load(load + a, push.force[a]);
    add_load(load + 3 + a, push.torque[a]);
  }
  if (counts) atomicAdd(load + 6, 1ull);
}

/// Pushes a vertex out of the colliders of this step, one after the other: contact.cpp.
__device__ __forceinline__ void touch_vertex(const CudaPbdField& f, float h,
                                             const CudaPbdCollider* colliders, int count,
                                             unsigned long long* loads, int i, const float4& x4,
                                             float4* moved) {
  if (x4.w == 0) return;
  const float4 m4 = *moved;
  const float start[3] = {x4.x, x4.y, x4.z};
  float m[3] = {m4.x, m4.y, m4.z};
  RoundedPlace place = place_of(start, m);
  const float* x = place.at;
  bool touches = false;
  for (int c = 0; c < count; ++c) {
    const CudaPbdCollider& collider = colliders[c];
    if (collider.shape.kind == Collider::kPlane) {
      if (x[2] >= collider.shape.position[2]) continue;
    } else if (x[0] < collider.min[0] || x[0] > collider.max[0] || x[1] < collider.min[1] ||
               x[1] > collider.max[1] || x[2] < collider.min[2] || x[2] > collider.max[2]) {
      continue;
    }
    const Gap g = gap_of(collider.shape, place);
    if (!(g.distance < 0)) continue;
    const float4 p4 = f.predicted[i], v4 = f.v[i];
    const float predicted[3] = {p4.x, p4.y, p4.z}, v[3] = {v4.x, v4.y, v4.z};
    const ContactPush push = push_out(collider.shape, g, h, f.mass[i], predicted, v, x, x4.w, m);
    place = place_of(start, m);
    touches = true;
    unsigned long long* load = loads + kPbdLoadSums * c;
    add_push(collider.shape, push, true, load);
    if (collider.shape.tool < 0) continue;
    if (push.distance < -collider.shape.inside && collider.shape.inside > 0) {
      atomicAdd(load + 7, 1ull);
      atomicMax(load + 8, static_cast<unsigned long long>(-push.distance * (1 / kInsideUnit)));
    }
  }
  if (!touches) return;
  f.pushed[i] = 1;
  *moved = make_float4(m[0], m[1], m[2], 0);
}

__device__ __forceinline__ void load_corners(const Triangle& t, const float4* x,
                                             const float4* moved, const float4* predicted,
                                             const float4* v, Corner (&corner)[3]) {
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const std::int32_t i = t[k];
    const float4 x4 = x[i], m4 = moved[i], p4 = predicted[i], v4 = v[i];
    corner[k] = {
        {x4.x, x4.y, x4.z, x4.w}, {m4.x, m4.y, m4.z}, {p4.x, p4.y, p4.z}, {v4.x, v4.y, v4.z}};
  }
}

/// Pushes triangles out of tips, one after the other as the CPU does, by one block of threads, all
/// of them together; leaves them in step. They look for the next that lies in its tip together, and
/// one pushes it. Apart, for its doubles would take registers from what each step does.
__device__ __noinline__ inline void push_out_of_tips(CudaPbdTips tips, int count,
                                                     const float4* predicted, const float4* v,
                                                     std::uint8_t* pushed, float h,
                                                     const CudaPbdCollider* colliders,
                                                     unsigned long long* loads, const float4* x,
                                                     float4* moved) {
  __shared__ int next;
  const int thread = static_cast<int>(threadIdx.x);
  Corner corner[3];
  TipPlace found;
  for (int round = 0, from = 0; round < kTipRounds;) {
    __syncthreads();
    if (thread == 0) next = count;
    __syncthreads();
    for (int i = from + thread; i < count; i += static_cast<int>(blockDim.x)) {
      const std::int32_t pair = tips.near[i];
      load_corners(tips.triangles[pair % tips.count], x, moved, predicted, v, corner);
      const Collider& tip = colliders[tips.sweeps[pair / tips.count].collider].shape;
      if (!find_in_tip(tip, corner, tips.mean_edge, found)) continue;
      atomicMin(&next, i);
      break;
    }
    __syncthreads();
    const int at = next;
    if (at == count) {
      if (from == 0) break;  // a round without any
      from = 0;
      ++round;
      continue;
    }
    if (thread == 0) {
      const std::int32_t pair = tips.near[at];
      const Triangle& t = tips.triangles[pair % tips.count];
      const std::int32_t c = tips.sweeps[pair / tips.count].collider;
      load_corners(t, x, moved, predicted, v, corner);
      ContactPush push;
      if (find_in_tip(colliders[c].shape, corner, tips.mean_edge, found) &&
          push_out_of_tip(colliders[c].shape, found, h, corner, push)) {
        for (int k = 0; k < 3; ++k) {
          moved[t[k]] = make_float4(corner[k].moved[0], corner[k].moved[1], corner[k].moved[2], 0);
          if (found.share[k] > 0) pushed[t[k]] = 1;
        }
        add_push(colliders[c].shape, push, round == 0, loads + kPbdLoadSums * c);
      }
    }
    from = at + 1;
  }
  __syncthreads();
}

}  // namespace pbd
}  // namespace tissue_sim
