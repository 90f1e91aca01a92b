#include <cmath>
#include <utility>

#include "compute/for_each_cuda.h"
#include "math/draw.h"
#include "mpm/cuda/cuda_linearised_motion.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 256;

/// Calls f(node, largest) for all nodes, which returns parts of two sums, and puts the largest
/// number that it names into `part_largest`.
template <class F>
__global__ void sum_over_nodes(int count, F f, double2* part_sum, float* part_largest) {
  __shared__ double2 sums[kThreads];
  __shared__ float most[kThreads];
  const int node = static_cast<int>(blockIdx.x * kThreads + threadIdx.x);
  const int t = static_cast<int>(threadIdx.x);
  float largest = 0;
  sums[t] = node < count ? f(node, largest) : double2{0, 0};
  most[t] = largest;
  for (int half = kThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (t >= half) continue;
    sums[t].x += sums[t + half].x;
    sums[t].y += sums[t + half].y;
    most[t] = fmaxf(most[t], most[t + half]);
  }
  if (t != 0) return;
  part_sum[blockIdx.x] = sums[0];
  part_largest[blockIdx.x] = most[0];
}

__global__ void largest_of(const float* parts, int count, float* largest) {
  __shared__ float most[kThreads];
  const int t = static_cast<int>(threadIdx.x);
  most[t] = 0;
  for (int i = t; i < count; i += kThreads) most[t] = fmaxf(most[t], parts[i]);
  for (int half = kThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (t < half) most[t] = fmaxf(most[t], most[t + half]);
  }
  if (t == 0) *largest = most[0];
}

__device__ __forceinline__ double dot3(const float4& a, const float4& b) {
  return static_cast<double>(a.x) * b.x + static_cast<double>(a.y) * b.y +
         static_cast<double>(a.z) * b.z;
}
__device__ __forceinline__ float largest3(const float4& a) {
  return fmaxf(fabsf(a.x), fmaxf(fabsf(a.y), fabsf(a.z)));
}
__device__ __forceinline__ float4 times(float s, const float4& a) {
  return {s * a.x, s * a.y, s * a.z, 0};
}

struct Start {
  CudaNodes present;
  float4* rates;
  float4* v;
  __device__ double2 operator()(int i, float& largest) const {
    const float mass = present.u[i].w, inv_mass = present.v[i].w;
    rates[i] = {0, 0, 0, inv_mass};
    const float4 x = {scattered(3 * i), scattered(3 * i + 1), scattered(3 * i + 2), 0};
    v[i] = times(sqrtf(inv_mass), x);
    largest = largest3(v[i]);
    return {mass * dot3(v[i], v[i]), 0};
  }
};

/// The sum of m v v, and the largest component of v.
struct Square {
  CudaNodes present;
  const float4* v;
  __device__ double2 operator()(int i, float& largest) const {
    largest = largest3(v[i]);
    return {present.u[i].w * dot3(v[i], v[i]), 0};
  }
};

/// u = present + scale v, with a scale that makes v's largest component `small`.
struct Displace {
  CudaNodes present;
  const float4* v;
  const float* largest;
  float small;
  float4* u;
  __device__ void operator()(int i) const {
    const float scale = *largest > 0 ? small / *largest : 0;
    const float4 at = present.u[i];
    u[i] = {at.x + scale * v[i].x, at.y + scale * v[i].y, at.z + scale * v[i].z, at.w};
  }
};

/// w from accelerations; sums of v w and of w w.
struct Difference {
  CudaNodes present;
  const float4 *at_rest, *v;
  const float* largest;
  float small;
  float4* w;
  __device__ double2 operator()(int i, float&) const {
    const float mass = present.u[i].w;
    if (!(mass > 0)) {
      w[i] = {0, 0, 0, 0};
      return {0, 0};
    }
    const float4 rest = at_rest[i], moved = w[i];
    w[i] = times(*largest / small, {rest.x - moved.x, rest.y - moved.y, rest.z - moved.z, 0});
    return {mass * dot3(w[i], v[i]), mass * dot3(w[i], w[i])};
  }
};

/// `before` becomes (w - along_v v - along_before before) times `scale`, the next v.
struct Next {
  const float4 *w, *v;
  float along_v, along_before, scale;
  float4* before;
  __device__ double2 operator()(int i, float& largest) const {
    const float4 x = w[i], a = times(along_v, v[i]), b = times(along_before, before[i]);
    before[i] = times(scale, {x.x - a.x - b.x, x.y - a.y - b.y, x.z - a.z - b.z, 0});
    largest = largest3(before[i]);
    return {0, 0};
  }
};

template <class F>
void launch(int count, int parts, const F& f, double2* sums, float* largest, cudaStream_t stream) {
  sum_over_nodes<<<parts, kThreads, 0, stream>>>(count, f, sums, largest);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace

CudaLinearisedMotion::CudaLinearisedMotion(const CudaNodes& present, const CudaNodes& scratch,
                                           std::size_t node_count, float small, Substep substep,
                                           Hold hold, CudaMotionRoom& room, cudaStream_t stream)
    : present_(present),
      scratch_(scratch),
      count_(static_cast<int>(node_count)),
      parts_((count_ + kThreads - 1) / kThreads),
      small_(small),
      substep_(std::move(substep)),
      hold_(std::move(hold)),
      stream_(stream),
      room_(room),
      u_(room.fields[0]),
      rates_(room.fields[1]),
      at_rest_(room.fields[2]),
      before_(room.fields[3]),
      v_(room.fields[4]) {
  room.largest.resize(1);
  room.part_sum.resize(parts_);
  room.part_largest.resize(parts_);
  room.host_sum.resize(parts_);
}

double2 CudaLinearisedMotion::sum() {
  room_.part_sum.download(room_.host_sum.data(), parts_, stream_);
  check_cuda(cudaStreamSynchronize(stream_), "measure its motion");
  double2 s{0, 0};
  for (int i = 0; i < parts_; ++i) {
    s.x += room_.host_sum[i].x;
    s.y += room_.host_sum[i].y;
  }
  return s;
}

void CudaLinearisedMotion::find_largest() {
  largest_of<<<1, kThreads, 0, stream_>>>(room_.part_largest.data(), parts_, room_.largest.data());
  check_cuda(cudaGetLastError(), "start a kernel");
}

void CudaLinearisedMotion::accelerate() {
  Gpu(stream_).for_each(count_, Displace{present_, v_, room_.largest.data(), small_, u_});
  substep_({u_, rates_}, scratch_);
}

void CudaLinearisedMotion::start() {
  check_cuda(cudaMemsetAsync(before_, 0, count_ * sizeof(float4), stream_), "clear memory");
  room_.largest.clear(stream_);
  launch(count_, parts_, Start{present_, rates_, v_}, room_.part_sum.data(),
         room_.part_largest.data(), stream_);
  if (hold_) {
    hold_(v_);
    launch(count_, parts_, Square{present_, v_}, room_.part_sum.data(), room_.part_largest.data(),
           stream_);
  }
  const double square = sum().x;
  accelerate();  // by nothing, for the largest is not known yet
  check_cuda(cudaMemcpyAsync(at_rest_, scratch_.v, count_ * sizeof(float4),
                             cudaMemcpyDeviceToDevice, stream_),
             "copy data");
  // v / |v|: the vector before it is 0, so it changes places with v.
  w_square_ = along_v_ = along_before_ = 0;
  const auto scale = static_cast<float>(square > 0 ? 1 / std::sqrt(square) : 0);
  launch(count_, parts_, Next{v_, before_, 0, 0, scale, before_}, room_.part_sum.data(),
         room_.part_largest.data(), stream_);
  find_largest();
  std::swap(before_, v_);
  check_cuda(cudaMemsetAsync(before_, 0, count_ * sizeof(float4), stream_), "clear memory");
}

double CudaLinearisedMotion::apply() {
  accelerate();
  launch(count_, parts_,
         Difference{present_, at_rest_, v_, room_.largest.data(), small_, scratch_.v},
         room_.part_sum.data(), room_.part_largest.data(), stream_);
  const double2 sums = sum();
  w_square_ = sums.y;
  return sums.x;
}

// v and the one before are of length 1 and at right angles, and w's shares of them are these.
double CudaLinearisedMotion::orthogonalise(double along_v, double along_before) {
  along_v_ = along_v;
  along_before_ = along_before;
  return std::sqrt(std::fmax(0.0, w_square_ - along_v * along_v - along_before * along_before));
}

void CudaLinearisedMotion::next(double length) {
  launch(count_, parts_,
         Next{scratch_.v, v_, static_cast<float>(along_v_), static_cast<float>(along_before_),
              static_cast<float>(1 / length), before_},
         room_.part_sum.data(), room_.part_largest.data(), stream_);
  find_largest();
  std::swap(before_, v_);
}

}  // namespace tissue_sim
