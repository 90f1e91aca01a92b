#include "compute/cuda_check.h"

namespace tissue_sim {
namespace {

__global__ void nothing() {}

}  // namespace

std::string why_no_gpu() {
  int count = 0;
  const cudaError_t result = cudaGetDeviceCount(&count);
  if (result != cudaSuccess) {
    cudaGetLastError();
    return std::string("CUDA finds no GPU (") + cudaGetErrorString(result) + ")";
  }
  if (count == 0) return "CUDA finds no GPU";
  int major = 0, minor = 0, cooperative = 0;
  check_cuda(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0), "be asked");
  check_cuda(cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, 0), "be asked");
  check_cuda(cudaDeviceGetAttribute(&cooperative, cudaDevAttrCooperativeLaunch, 0), "be asked");
  const int capability = 10 * major + minor;
  if (capability < 75 || cooperative == 0) {
    return "the GPU is too old: compute capability 7.5 or more is needed";
  }
  cudaFuncAttributes code;  // says whether there is any that this GPU and its driver take
  const cudaError_t loaded = cudaFuncGetAttributes(&code, nothing);
  if (loaded != cudaSuccess) {
    cudaGetLastError();
    const std::string why = cudaGetErrorString(loaded);
    if (loaded == cudaErrorNoKernelImageForDevice || loaded == cudaErrorInvalidPtx ||
        loaded == cudaErrorUnsupportedPtxVersion || loaded == cudaErrorInvalidKernelImage) {
      return "this build has no code for the GPU, of compute capability " + std::to_string(major) +
             "." + std::to_string(minor) + " (" + why +
             "): build with -DCMAKE_CUDA_ARCHITECTURES=" + std::to_string(capability);
    }
    return "the GPU cannot be used now (" + why + "): nvidia-smi says which programs use it";
  }
  return "";
}

std::string open_gpu(cudaStream_t& stream) {
  const std::string why = why_no_gpu();
  if (!why.empty()) throw std::runtime_error(why + "; set device to cpu");
  check_cuda(cudaSetDevice(0), "be chosen");
  cudaDeviceProp properties;
  check_cuda(cudaGetDeviceProperties(&properties, 0), "be asked");
  check_cuda(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "make a stream");
  return properties.name;
}

}  // namespace tissue_sim
