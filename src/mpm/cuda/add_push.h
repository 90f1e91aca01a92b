// Forces on nodes as integers, whose sum does not depend on the order. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Adds a share of a force [N] to the sum of a node: see NodePushes.
__device__ __forceinline__ void add_push(long long* sums, int node, float weight,
                                         const float* force) {
  long long* sum = sums + kPushStride * static_cast<std::size_t>(node);
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    const long long push = __float2ll_rn(weight * force[c] * static_cast<float>(1 / kLoadUnit));
    atomicAdd(reinterpret_cast<unsigned long long*>(sum) + c,
              static_cast<unsigned long long>(push));
  }
}

}  // namespace tissue_sim
