// for_each on the GPU: launches the functor that compute/for_each.h spreads over CPU threads. For
// .cu files.
#pragma once

#include "compute/cuda_check.h"

namespace tissue_sim {

template <class F>
__global__ void for_each_index(int n, F f) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < n) f(i);
}

/// The GPU with a stream of work.
class Gpu {
 public:
  explicit Gpu(cudaStream_t stream = nullptr) : stream_(stream) {}

  /// Enqueues f(i) for each i in [0, n), all at once.
  template <class F>
  void for_each(int n, const F& f) const {
    constexpr int kThreads = 128;
    if (n <= 0) return;
    for_each_index<<<(n + kThreads - 1) / kThreads, kThreads, 0, stream_>>>(n, f);
    check_cuda(cudaGetLastError(), "start a kernel");
  }
  void wait() const { check_cuda(cudaStreamSynchronize(stream_), "finish a kernel"); }

 private:
  cudaStream_t stream_;
};

}  // namespace tissue_sim
