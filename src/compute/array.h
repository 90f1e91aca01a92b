// Array: a vector whose elements start on a cache line, as SIMD loads and the GPU like them. There
// is room for a cache line of them behind the last, which may be read.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <vector>

namespace tissue_sim {

template <class T>
struct CacheLineAllocator {
  using value_type = T;
  CacheLineAllocator() = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) {}  // NOLINT: rebinding converts
  T* allocate(std::size_t n) {
    void* p = std::aligned_alloc(64, (n * sizeof(T) / 64 + 2) * 64);
    if (p == nullptr) throw std::bad_alloc();
    return static_cast<T*>(p);
  }
  void deallocate(T* p, std::size_t) { std::free(p); }
  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator&) { return true; }
  friend bool operator!=(const CacheLineAllocator&, const CacheLineAllocator&) { return false; }
};

template <class T>
using Array = std::vector<T, CacheLineAllocator<T>>;

}  // namespace tissue_sim
