// Blocks of threads of a cluster write into one another's shared memory. For .cu files, compute
// capability 9.0 and CUDA 11.8.
#pragma once

#include <cstdint>

namespace tissue_sim {
namespace pbd {

#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900

/// Of a place in this block's shared memory.
__device__ __forceinline__ unsigned shared_address(const void* place) {
  return static_cast<unsigned>(__cvta_generic_to_shared(place));
}
/// The same place of another block.
__device__ __forceinline__ unsigned address_in(unsigned address, int block) {
  unsigned there;
  asm volatile("mapa.shared::cluster.u32 %0, %1, %2;" : "=r"(there) : "r"(address), "r"(block));
  return there;
}

/// What all threads of all blocks wait at, and see what was written before.
__device__ __forceinline__ void wait_for_cluster() {
  asm volatile(
      "barrier.cluster.arrive.release;\n"
      "barrier.cluster.wait.acquire;" ::
          : "memory");
}

/// Counts the bytes that others write into a block's shared memory, and lets its threads wait for
/// them.
struct Mailbox {
  std::uint64_t barrier;

  /// By one thread; wait_for_cluster() comes before others send.
  __device__ __forceinline__ void open() {
    asm volatile("mbarrier.init.shared::cta.b64 [%0], 1;" ::"r"(shared_address(&barrier)));
    asm volatile("fence.mbarrier_init.release.cluster;" ::: "memory");
  }
  /// By one thread, once for each time that all wait.
  __device__ __forceinline__ void expect(int bytes) {
    asm volatile(
        "mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;" ::"r"(shared_address(&barrier)),
        "r"(bytes)
        : "memory");
  }
  /// Writes `value` to the same place of another block, whose mailbox counts it.
  __device__ __forceinline__ void send(const float4& value, const float4* place, int block) {
    asm volatile(
        "st.async.shared::cluster.mbarrier::complete_tx::bytes.v4.f32 [%0], {%1, %2, %3, %4}, "
        "[%5];" ::"r"(address_in(shared_address(place), block)),
        "f"(value.x), "f"(value.y), "f"(value.z), "f"(value.w),
        "r"(address_in(shared_address(&barrier), block))
        : "memory");
  }
  /// `time` counts how often it was waited for.
  __device__ __forceinline__ void wait(int time) {
    unsigned done;
    do {
      asm volatile(
          "{\n"
          ".reg .pred all;\n"
          "mbarrier.try_wait.parity.shared::cta.b64 all, [%1], %2;\n"
          "selp.u32 %0, 1, 0, all;\n"
          "}"
          : "=r"(done)
          : "r"(shared_address(&barrier)), "r"(static_cast<unsigned>(time % 2))
          : "memory");
    } while (done == 0);
  }
};

#endif

}  // namespace pbd
}  // namespace tissue_sim
