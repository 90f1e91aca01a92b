// Union-find by many threads at once (Jaiganesh and Burtscher, A high-performance connected
// components implementation for GPUs, HPDC 2018). For .cu files.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// The root of an element's tree, which its path is made half as long for. Others may do the same.
__device__ __forceinline__ std::int32_t root(volatile std::int32_t* parent, std::int32_t p) {
  std::int32_t above = parent[p];
  while (above != p) {
    const std::int32_t next = parent[above];
    if (next == above) return above;
    parent[p] = next;
    p = next;
    above = parent[p];
  }
  return p;
}

/// Joins two trees: the root with the higher number hangs on the lower one, so that in the end each
/// root is the lowest of its elements, whatever the order.
__device__ __forceinline__ void join(std::int32_t* parent, std::int32_t a, std::int32_t b) {
  a = root(parent, a);
  b = root(parent, b);
  while (a != b) {
    const std::int32_t high = a > b ? a : b, low = a > b ? b : a;
    const std::int32_t found = atomicCAS(parent + high, high, low);
    if (found == high) return;
    a = root(parent, found);
    b = low;
  }
}

}  // namespace tissue_sim
