// What CUDA calls return, as exceptions with a clear word. Only the GPU backend includes this.
#pragma once

#include <cuda_runtime_api.h>

#include <stdexcept>
#include <string>

namespace tissue_sim {

/// Throws std::runtime_error for anything but success; `action` is what was being done.
inline void check_cuda(cudaError_t result, const char* action) {
  if (result == cudaSuccess) return;
  cudaGetLastError();  // not to be met again by the next call
  throw std::runtime_error(std::string("the GPU failed to ") + action + ": " +
                           cudaGetErrorString(result));
}

/// Why no GPU can be used here; empty where there is one.
std::string why_no_gpu();
/// Chooses the GPU and makes a stream on it. Returns its name. Throws std::runtime_error where
/// there is none to use.
std::string open_gpu(cudaStream_t& stream);

}  // namespace tissue_sim
