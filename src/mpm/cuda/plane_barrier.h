// A barrier of a thread block at which arriving and waiting are apart. For .cu files.
#pragma once

#include <cstdint>

// From compute capability 9.0 on a thread may sleep while it waits.
#if __CUDA_ARCH__ >= 900
#define TISSUE_SIM_WAIT "try_wait"
#else
#define TISSUE_SIM_WAIT "test_wait"
#endif

namespace tissue_sim {

/// All threads call arrive() and wait() in turn; what a thread wrote before it arrived is there for
/// all that waited. Between the two a thread may do what needs nothing of the others. GPUs before
/// compute capability 8.0 wait for each other in wait() alone.
class PlaneBarrier {
 public:
  /// `place`: 8 bytes of shared memory. Needs __syncthreads() before it is used.
  __device__ __forceinline__ explicit PlaneBarrier(std::uint64_t* place)
      : place_(static_cast<unsigned>(__cvta_generic_to_shared(place))) {
#if __CUDA_ARCH__ >= 800
    if (threadIdx.x == 0) {
      asm volatile("mbarrier.init.shared.b64 [%0], %1;" ::"r"(place_), "r"(blockDim.x));
    }
#endif
  }
  __device__ __forceinline__ void arrive() {
#if __CUDA_ARCH__ >= 800
    asm volatile("{ .reg .b64 state; mbarrier.arrive.shared.b64 state, [%0]; }" ::"r"(place_)
                 : "memory");
#endif
  }
  __device__ __forceinline__ void wait() {
#if __CUDA_ARCH__ >= 800
    unsigned done;
    do {
      asm volatile("{ .reg .pred done; mbarrier." TISSUE_SIM_WAIT
                   ".parity.shared.b64 done, [%1], %2; "
                   "selp.u32 %0, 1, 0, done; }"
                   : "=r"(done)
                   : "r"(place_), "r"(parity_)
                   : "memory");
    } while (done == 0);
    parity_ ^= 1;
#else
    __syncthreads();
#endif
  }

 private:
  unsigned place_;
  unsigned parity_ = 0;
};

}  // namespace tissue_sim

#undef TISSUE_SIM_WAIT
