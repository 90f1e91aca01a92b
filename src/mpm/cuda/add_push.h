// Forces on nodes as integers, whose sum does not depend on the order. For .cu files.
#pragma once

#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Adds what pushes a node [N] to component c of its sum: see NodePushes.
__device__ __forceinline__ void add_push(long long* sums, int node, int c, float push) {
  const long long units = __float2ll_rn(push * static_cast<float>(1 / kLoadUnit));
  long long* sum = sums + kPushStride * static_cast<std::size_t>(node) + c;
  atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(units));
}

/// Adds a share of a force [N] to all of it.
__device__ __forceinline__ void add_push(long long* sums, int node, float weight,
                                         const float* force) {
#pragma unroll
  for (int c = 0; c < 3; ++c) add_push(sums, node, c, weight * force[c]);
}

}  // namespace tissue_sim
