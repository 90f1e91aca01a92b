#include "compute/cuda_check.h"

namespace tissue_sim {

std::string why_no_gpu() {
  int count = 0;
  const cudaError_t result = cudaGetDeviceCount(&count);
  if (result != cudaSuccess) {
    cudaGetLastError();
    return std::string("CUDA finds no GPU (") + cudaGetErrorString(result) + ")";
  }
  if (count == 0) return "CUDA finds no GPU";
  int major = 0, cooperative = 0;
  check_cuda(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0), "be asked");
  check_cuda(cudaDeviceGetAttribute(&cooperative, cudaDevAttrCooperativeLaunch, 0), "be asked");
  if (major < 7 || cooperative == 0) {
    return "the GPU is too old: compute capability 7.5 or more is needed";
  }
  return "";
}

}  // namespace tissue_sim
