// What tells lanes apart without branches, for T = float (GPU, where a mask is a bool) or Vec<W>
// (CPU).
#pragma once

#include <cmath>

#include "compute/simd.h"

namespace tissue_sim {

TISSUE_SIM_INLINE bool less(float a, float b) { return a < b; }
TISSUE_SIM_INLINE float choose(bool mask, float a, float b) { return mask ? a : b; }
TISSUE_SIM_INLINE bool none_of(bool mask) { return !mask; }
// Two bools joined by & or | are an int.
TISSUE_SIM_INLINE float choose(int mask, float a, float b) { return mask != 0 ? a : b; }
TISSUE_SIM_INLINE int none_of(int mask) { return mask == 0 ? 1 : 0; }
TISSUE_SIM_INLINE float square_root(float x) { return sqrtf(x); }

/// Where a < b. By the sign of a - b: see any_negative().
template <class T>
TISSUE_SIM_INLINE auto less(T a, T b) {
  typedef std::int32_t Bits __attribute__((vector_size(sizeof(T))));
  return (Bits)(a - b) >> 31;
}
/// a where the mask is set, else b.
template <class T, class M>
TISSUE_SIM_INLINE T choose(M mask, T a, T b) {
  return (T)(((M)a & mask) | ((M)b & ~mask));
}
template <class M>
TISSUE_SIM_INLINE M none_of(M mask) {
  return ~mask;
}
template <class T>
TISSUE_SIM_INLINE T square_root(T x) {
  constexpr int kLanes = sizeof(T) / sizeof(float);
  alignas(sizeof(T)) float lanes[kLanes];
  std::memcpy(lanes, &x, sizeof(x));
  for (int l = 0; l < kLanes; ++l) lanes[l] = sqrtf(lanes[l]);
  std::memcpy(&x, lanes, sizeof(x));
  return x;
}
/// The same number in all lanes.
template <class T>
TISSUE_SIM_INLINE T all_lanes(float x) {
  return T{} + x;
}
template <class T>
TISSUE_SIM_INLINE T larger(T a, T b) {
  return choose(less(a, b), b, a);
}

}  // namespace tissue_sim
