#include "compute/for_each_cuda.h"
#include "mpm/cuda/held_points.h"

namespace tissue_sim {
namespace {

struct ListHeld {
  const std::uint8_t* with;
  const float4* hold;
  HeldPoint* held;
  int most;
  int* count;
  __device__ void operator()(int i) const {
    if (with[i] == 0) return;
    const int at = atomicAdd(count, 1);
    if (at >= most) return;
    const float4 h = hold[i];
    held[at] = {i, with[i], {h.x, h.y, h.z, h.w}};
  }
};

struct HoldAgain {
  const HeldPoint* held;
  std::uint8_t* with;
  float4* hold;
  __device__ void operator()(int i) const {
    const HeldPoint& p = held[i];
    with[p.entry] = p.with;
    hold[p.entry] = {p.hold[0], p.hold[1], p.hold[2], p.hold[3]};
  }
};

}  // namespace

void launch_list_held(const std::uint8_t* with, const float4* hold, int entries, HeldPoint* held,
                      int most, int* count, cudaStream_t stream) {
  check_cuda(cudaMemsetAsync(count, 0, sizeof(int), stream), "clear memory");
  Gpu(stream).for_each(entries, ListHeld{with, hold, held, most, count});
}

void launch_hold_again(const HeldPoint* held, int count, std::uint8_t* with, float4* hold,
                       cudaStream_t stream) {
  Gpu(stream).for_each(count, HoldAgain{held, with, hold});
}

}  // namespace tissue_sim
