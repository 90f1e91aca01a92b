// What the kernels that take all steps of a frame share. For .cu files.
#pragma once

#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {

/// A chunk for each warp of the blocks of threads, of which this is the one with this `rank`, in a
/// fixed order.
__device__ __forceinline__ void sum_flights(const CudaPbdField& f, const CudaPbdFlights& flights,
                                            const float4* x, int rank, int blocks,
                                            CudaPbdFlight* result) {
  const int lane = static_cast<int>(threadIdx.x) % 32, warps = static_cast<int>(blockDim.x) / 32;
  for (int c = rank * warps + static_cast<int>(threadIdx.x) / 32; c < flights.count;
       c += blocks * warps) {
    const CudaPbdChunk chunk = flights.chunks[c];
    const float4 origin = x[chunk.first];
    CudaPbdFlight sum = {{origin.x, origin.y, origin.z}, {}, {}, {}, {}, 0};
    for (int k = chunk.begin + lane; k < chunk.end; k += 32) {
      const int i = flights.order[k];
      add_to_flight(x[i], f.v[i], f.mass[i], f.pushed[i], sum);
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

/// By a block of threads.
template <class T>
__device__ __forceinline__ void copy_words(const T* from, T* to, int count) {
  const int words = count * static_cast<int>(sizeof(T) / 4);
  for (int i = static_cast<int>(threadIdx.x); i < words; i += static_cast<int>(blockDim.x)) {
    reinterpret_cast<std::int32_t*>(to)[i] = reinterpret_cast<const std::int32_t*>(from)[i];
  }
}

/// That a block of threads may have.
inline std::size_t most_shared_bytes() {
  static const int most = [] {
    int bytes = 0;
    check_cuda(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, 0),
               "be asked");
    return bytes;
  }();
  return static_cast<std::size_t>(most);
}

}  // namespace pbd
}  // namespace tissue_sim
