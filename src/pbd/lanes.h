// Real numbers of constraints: a float, or the W lanes of a vector. What the functions of
// constraints.h need of either, and how W vertices come into lanes and go back.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/rows.h"
#include "compute/simd.h"

namespace tissue_sim {
namespace pbd {

TISSUE_SIM_INLINE float root(float v) { return sqrtf(v); }
TISSUE_SIM_INLINE float magnitude(float v) { return fabsf(v); }
/// a where v is negative (its sign bit set), else b.
TISSUE_SIM_INLINE float where_negative(float v, float a, float b) { return v < 0 ? a : b; }
/// On a GPU within two units in the last place, and no more instructions for large divisors.
TISSUE_SIM_INLINE float quotient(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fdividef(a, b);
#else
  return a / b;
#endif
}

#define TISSUE_SIM_LANES(W)                                               \
  TISSUE_SIM_INLINE Vec<W> root(Vec<W> v) {                               \
    Vec<W> r;                                                             \
    for (int i = 0; i < W; ++i) r[i] = __builtin_sqrtf(v[i]);             \
    return r;                                                             \
  }                                                                       \
  TISSUE_SIM_INLINE Vec<W> magnitude(Vec<W> v) {                          \
    return reinterpret_cast<Vec<W>>(bits<W>(v) & 0x7fffffff);             \
  }                                                                       \
  TISSUE_SIM_INLINE Vec<W> where_negative(Vec<W> v, Vec<W> a, Vec<W> b) { \
    return either<W>(bits<W>(v) >> 31, a, b);                             \
  }                                                                       \
  TISSUE_SIM_INLINE Vec<W> quotient(Vec<W> a, Vec<W> b) { return a / b; }
#if !defined(__CUDACC__)
TISSUE_SIM_LANES(4)
TISSUE_SIM_LANES(8)
TISSUE_SIM_LANES(16)
#endif
#undef TISSUE_SIM_LANES

template <class V>
TISSUE_SIM_INLINE V greater(V a, V b) {
  return where_negative(a - b, b, a);
}
template <class V>
TISSUE_SIM_INLINE V lesser(V a, V b) {
  return where_negative(a - b, a, b);
}
/// On a GPU by one instruction.
TISSUE_SIM_INLINE float greater(float a, float b) {
#if defined(__CUDA_ARCH__)
  return fmaxf(a, b);
#else
  return greater<float>(a, b);
#endif
}
TISSUE_SIM_INLINE float lesser(float a, float b) {
#if defined(__CUDA_ARCH__)
  return fminf(a, b);
#else
  return lesser<float>(a, b);
#endif
}

/// Angle of (x, y) to the x axis, -pi to pi, within 4e-6 (Hastings' polynomial, refined). 0 at
/// (0, 0).
template <class V>
TISSUE_SIM_INLINE V angle_of(V y, V x) {
  const V ax = magnitude(x), ay = magnitude(y);
  const V t = quotient(lesser(ax, ay), greater(ax, ay) + 1e-30f), t2 = t * t;
  V r =
      t * (0.99997726f +
           t2 * (-0.33262347f +
                 t2 * (0.19354346f + t2 * (-0.11643287f + t2 * (0.05265332f - 0.01172120f * t2)))));
  r = where_negative(ax - ay, 1.57079632679f - r, r);
  r = where_negative(x, 3.14159265359f - r, r);
  return where_negative(y, -r, r);
}

template <class V>
struct Vector {
  V x, y, z;
};

/// A vertex in each lane: where it was [m], its inverse mass [1/kg], and how far it has moved from
/// there, which is apart: the sum would round off what a short step moves.
template <class V>
struct Vertex {
  V x, y, z, w;
  Vector<V> moved = {};
};

#if !defined(__CUDACC__)
template <int W>
TISSUE_SIM_INLINE void store_row(float* x, const std::int32_t* index, int i, Vec<W> row) {
  const auto at = [x, index](int k) -> Vec<4>& {
    return *reinterpret_cast<Vec<4>*>(x + 4 * static_cast<std::ptrdiff_t>(index[k]));
  };
  if constexpr (W == 4) {
    at(i) = row;
#if defined(__x86_64__)
  } else if constexpr (W == 8) {
    asm("vextractf128 $0, %1, %0" : "=m"(at(i)) : "x"(row));
    asm("vextractf128 $1, %1, %0" : "=m"(at(i + 4)) : "x"(row));
  } else {
    asm("vextractf32x4 $0, %1, %0" : "=m"(at(i)) : "v"(row));
    asm("vextractf32x4 $1, %1, %0" : "=m"(at(i + 4)) : "v"(row));
    asm("vextractf32x4 $2, %1, %0" : "=m"(at(i + 8)) : "v"(row));
    asm("vextractf32x4 $3, %1, %0" : "=m"(at(i + 12)) : "v"(row));
#endif
  }
}

/// Vertices index[0 .. W - 1]; x and moved hold four floats each, aligned.
template <int W>
TISSUE_SIM_INLINE Vertex<Vec<W>> gather(const float* x, const float* moved,
                                        const std::int32_t* index) {
  Vec<W> r[4], m[4];
  for (int i = 0; i < 4; ++i) {
    r[i] = load_row<W>(x, index, i);
    m[i] = load_row<W>(moved, index, i);
  }
  transpose<W>(r);
  transpose<W>(m);
  return {r[0], r[1], r[2], r[3], {m[0], m[1], m[2]}};
}

/// How far they have moved.
template <int W>
TISSUE_SIM_INLINE void scatter(float* moved, const std::int32_t* index, const Vertex<Vec<W>>& v) {
  Vec<W> r[4] = {v.moved.x, v.moved.y, v.moved.z, Vec<W>{}};
  transpose<W>(r);
  for (int i = 0; i < 4; ++i) store_row<W>(moved, index, i, r[i]);
}
#endif

}  // namespace pbd
}  // namespace tissue_sim
