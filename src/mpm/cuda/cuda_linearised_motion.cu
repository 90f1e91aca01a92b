#include <cmath>
#include <utility>

#include "compute/for_each_cuda.h"
#include "mpm/cuda/cuda_linearised_motion.h"
#include "mpm/small_motion.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 256;

/// Calls f(node) for all nodes, which returns a part of the sum, and puts the largest number that
/// it names into `largest`.
template <class F>
__global__ void sum_over_nodes(int count, F f, double* part_sum, float* part_largest) {
  __shared__ double sums[kThreads];
  __shared__ float most[kThreads];
  const int node = static_cast<int>(blockIdx.x * kThreads + threadIdx.x);
  const int t = static_cast<int>(threadIdx.x);
  float largest = 0;
  sums[t] = node < count ? f(node, largest) : 0.0;
  most[t] = largest;
  for (int half = kThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (t >= half) continue;
    sums[t] += sums[t + half];
    most[t] = fmaxf(most[t], most[t + half]);
  }
  if (t != 0) return;
  part_sum[blockIdx.x] = sums[0];
  part_largest[blockIdx.x] = most[0];
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
  __device__ double operator()(int i, float& largest) const {
    const float mass = present.u[i].w, inv_mass = present.v[i].w;
    rates[i] = {0, 0, 0, inv_mass};
    const float4 x = {scattered(3 * i), scattered(3 * i + 1), scattered(3 * i + 2), 0};
    v[i] = times(sqrtf(inv_mass), x);
    largest = largest3(v[i]);
    return mass * dot3(v[i], v[i]);
  }
};

struct Displace {
  CudaNodes present;
  const float4* v;
  float scale;
  float4* u;
  __device__ void operator()(int i) const {
    const float4 at = present.u[i];
    u[i] = {at.x + scale * v[i].x, at.y + scale * v[i].y, at.z + scale * v[i].z, at.w};
  }
};

struct Difference {
  CudaNodes present;
  const float4 *at_rest, *v;
  float back;
  float4* w;
  __device__ double operator()(int i, float&) const {
    const float mass = present.u[i].w;
    if (!(mass > 0)) {
      w[i] = {0, 0, 0, 0};
      return 0;
    }
    const float4 rest = at_rest[i], moved = w[i];
    w[i] = times(back, {rest.x - moved.x, rest.y - moved.y, rest.z - moved.z, 0});
    return mass * dot3(w[i], v[i]);
  }
};

struct Orthogonalise {
  CudaNodes present;
  const float4 *v, *before;
  float along_v, along_before;
  float4* w;
  __device__ double operator()(int i, float&) const {
    const float4 x = w[i], a = times(along_v, v[i]), b = times(along_before, before[i]);
    w[i] = {x.x - a.x - b.x, x.y - a.y - b.y, x.z - a.z - b.z, 0};
    return present.u[i].w * dot3(w[i], w[i]);
  }
};

struct Scale {
  const float4* from;
  float scale;
  float4* to;
  __device__ double operator()(int i, float& largest) const {
    to[i] = times(scale, from[i]);
    largest = largest3(to[i]);
    return 0;
  }
};

template <class F>
void launch(int count, int parts, const F& f, double* sums, float* largest, cudaStream_t stream) {
  sum_over_nodes<<<parts, kThreads, 0, stream>>>(count, f, sums, largest);
  check_cuda(cudaGetLastError(), "start a kernel");
}

}  // namespace

CudaLinearisedMotion::CudaLinearisedMotion(const CudaNodes& present, const CudaNodes& scratch,
                                           std::size_t node_count, double cell_size,
                                           Substep substep, cudaStream_t stream)
    : present_(present),
      scratch_(scratch),
      count_(static_cast<int>(node_count)),
      parts_((count_ + kThreads - 1) / kThreads),
      cell_size_(cell_size),
      substep_(std::move(substep)),
      stream_(stream) {
  for (DeviceArray<float4>* x : {&u_, &rates_, &at_rest_, &before_, &v_}) x->resize(node_count);
  part_sum_.resize(parts_);
  part_largest_.resize(parts_);
  host_sum_.resize(parts_);
  host_largest_.resize(parts_);
  before_at_ = before_.data();
  v_at_ = v_.data();
}

double CudaLinearisedMotion::sum() {
  part_sum_.download(host_sum_.data(), parts_, stream_);
  part_largest_.download(host_largest_.data(), parts_, stream_);
  check_cuda(cudaStreamSynchronize(stream_), "measure its motion");
  double s = 0;
  for (int i = 0; i < parts_; ++i) s += host_sum_[i];
  return s;
}

float CudaLinearisedMotion::largest() {
  float most = 0;
  for (int i = 0; i < parts_; ++i) most = std::fmax(most, host_largest_[i]);
  return most;
}

void CudaLinearisedMotion::accelerate(float scale) {
  Gpu(stream_).for_each(count_, Displace{present_, v_at_, scale, u_.data()});
  substep_({u_.data(), rates_.data()}, scratch_);
}

void CudaLinearisedMotion::start() {
  before_.clear(stream_);
  launch(count_, parts_, Start{present_, rates_.data(), v_at_}, part_sum_.data(),
         part_largest_.data(), stream_);
  const double square = sum();
  const auto scale = static_cast<float>(square > 0 ? 1 / std::sqrt(square) : 0);
  accelerate(0);
  check_cuda(cudaMemcpyAsync(at_rest_.data(), scratch_.v, count_ * sizeof(float4),
                             cudaMemcpyDeviceToDevice, stream_),
             "copy data");
  launch(count_, parts_, Scale{v_at_, scale, v_at_}, part_sum_.data(), part_largest_.data(),
         stream_);
  sum();
  largest_ = largest();
}

double CudaLinearisedMotion::apply() {
  if (!(largest_ > 0)) return 0;
  const float scale = kSmallMotion * static_cast<float>(cell_size_) / largest_;
  accelerate(scale);
  launch(count_, parts_, Difference{present_, at_rest_.data(), v_at_, 1 / scale, scratch_.v},
         part_sum_.data(), part_largest_.data(), stream_);
  return sum();
}

double CudaLinearisedMotion::orthogonalise(double along_v, double along_before) {
  launch(count_, parts_,
         Orthogonalise{present_, v_at_, before_at_, static_cast<float>(along_v),
                       static_cast<float>(along_before), scratch_.v},
         part_sum_.data(), part_largest_.data(), stream_);
  return std::sqrt(sum());
}

void CudaLinearisedMotion::next(double length) {
  std::swap(before_at_, v_at_);
  launch(count_, parts_, Scale{scratch_.v, static_cast<float>(1 / length), v_at_}, part_sum_.data(),
         part_largest_.data(), stream_);
  sum();
  largest_ = largest();
}

}  // namespace tissue_sim
