// The trace of the stretch U of a deformation gradient F = R U and what the rotation R follows
// from, for T = float (GPU), double (reference) or Vec<W> (CPU).
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "compute/host_device.h"

namespace tissue_sim {

/// Integers with the bits of a float or of a vector of floats.
template <class T>
struct BitsOf {
  typedef std::int32_t type __attribute__((vector_size(sizeof(T))));
};
template <>
struct BitsOf<float> {
  typedef std::int32_t type;
};

// First guesses, for Halley's method and Newton's to refine: integer arithmetic on the exponent,
// which is the same on every processor and waits for no divider.

/// The square root of x >= 0, at most 4 % off (`share` 1), times about `share`.
TISSUE_SIM_INLINE double root_guess(double x, float share) { return share * sqrt(x); }
template <class T>
TISSUE_SIM_INLINE T root_guess(T x, float share) {
  typename BitsOf<T>::type bits;
  std::memcpy(&bits, &x, sizeof(x));
  bits = (bits >> 1) + (0x1fbd1df5 - static_cast<std::int32_t>((1 - share) * 0x1000000));
  std::memcpy(&x, &bits, sizeof(x));
  return x;
}
/// 1 / x for x > 0, at most 12 % off.
TISSUE_SIM_INLINE double reciprocal_guess(double x) { return 1 / x; }
template <class T>
TISSUE_SIM_INLINE T reciprocal_guess(T x) {
  typename BitsOf<T>::type bits;
  std::memcpy(&bits, &x, sizeof(x));
  bits = 0x7ef311c7 - bits;
  std::memcpy(&x, &bits, sizeof(x));
  return x;
}
/// Newton's step from r towards 1 / x.
template <class T>
TISSUE_SIM_INLINE T nearer_reciprocal(T r, T x) {
  return r + r * (1.0f - x * r);
}

/// Invariants of C = F^T F and det F.
template <class T>
struct Invariants {
  T c1;  ///< tr C = ||F||^2
  T c2;  ///< second invariant of C, ||cof F||^2
  T J;   ///< det F
};

/// Invariants of the stretch U = sqrt(F^T F) of a deformation gradient, and what the rotation
/// follows from: R = 2 ((b + c1) F - F C + a cof F) * inverse_slope.
template <class T>
struct Stretch {
  T a;              ///< tr U (with the smallest stretch negative where det F < 0)
  T b;              ///< second invariant of U
  T inverse_slope;  ///< 1 / (2 (a b - J)) = 1 / (2 (s1 + s2) (s2 + s3) (s3 + s1))
};

/// f(a) = (a^2 - tr C)^2 / 4 - ||cof F||^2 - 2 J a, of which tr U is the largest root (Franca
/// 1989).
template <class T>
struct Quartic {
  T p;             ///< a^2 - tr C: twice the second invariant of U at the root
  T slope, value;  ///< f'(a), f(a); the second derivative is 3 p + 2 tr C
  TISSUE_SIM_INLINE Quartic(const Invariants<T>& of, T a)
      : p(a * a - of.c1),
        slope(a * p - (of.J + of.J)),
        value(0.25f * p * p - of.c2 - (of.J + of.J) * a) {}
};

/// tr U and what follows from it (that R is its derivative is used by Lin, Chitalu and Komura 2022)
/// for N points side by side: each step waits for the one before, and a processor has other points
/// to work on meanwhile. By Halley's method, whose error shrinks to its third power, from
/// a^2 = tr C + 2 b and b^2 <= 3 ||cof F||^2. Relative error below 1e-6 for stretches between 1/3
/// and 3; finite for inverted F.
template <int N, class T>
TISSUE_SIM_INLINE void stretch(const Invariants<T>* of, Stretch<T>* s) {
  constexpr int steps = std::is_same<T, double>::value ? 3 : 2;
  T a[N], r[N];
  for (int k = 0; k < N; ++k) {
    a[k] = root_guess(of[k].c1 + 1.94f * root_guess(3.0f * of[k].c2, 1), 0.984375f);
  }
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; k < N; ++k) {
      const Quartic<T> f(of[k], a[k]);
      const T d = f.slope * f.slope - f.value * (1.5f * f.p + of[k].c1);
      r[k] = reciprocal_guess(d);
      if (i > 0) r[k] = nearer_reciprocal(r[k], d);
      a[k] -= f.value * f.slope * r[k];
    }
  }
  for (int k = 0; k < N; ++k) {  // Newton's step, so that an undeformed point has exactly 3
    const Quartic<T> f(of[k], a[k]);
    r[k] = nearer_reciprocal(f.slope * r[k], f.slope);  // d was the slope's square, nearly
    a[k] -= f.value * r[k];
  }
  for (int k = 0; k < N; ++k) {
    const Quartic<T> f(of[k], a[k]);
    s[k] = {a[k], 0.5f * f.p, nearer_reciprocal(nearer_reciprocal(r[k], f.slope), f.slope)};
  }
}

#if defined(__CUDA_ARCH__)
/// Square root and 1 / x in one instruction, to the last bit but one.
TISSUE_SIM_INLINE float fast_root(float x) {
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(x) : "f"(x));
  return x;
}
TISSUE_SIM_INLINE float fast_reciprocal(float x) {
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(x) : "f"(x));
  return x;
}

/// The same where roots and reciprocals are cheap, by a step of Newton's method and one of
/// Halley's: from b^2 = ||cof F||^2 + 2 J a with the bounds sqrt(3 tr C) of a where J > 0 and
/// sqrt(tr C / 3) where J < 0 comes a start that is too large by 1.8 % at most where J > 0, so that
/// they leave 1.4e-8 for stretches between 1/3 and 3; the 1e-4 keep the slope of a flat F from 0.
template <int N>
TISSUE_SIM_INLINE void stretch(const Invariants<float>* of, Stretch<float>* s) {
  // Each step for all points: written so, the compiler lets one's steps hide the other's waits for
  // its roots.
  float c24[N], j8[N], a[N], b2[N], p[N], f1[N], value4[N];
#pragma unroll
  for (int k = 0; k < N; ++k) b2[k] = fast_root(3.0f * of[k].c1);
#pragma unroll
  for (int k = 0; k < N; ++k) {
    c24[k] = 4.0f * of[k].c2;
    j8[k] = 8.0f * of[k].J;
    b2[k] = fast_root(fabsf(c24[k] + fmaxf(j8[k], (8.0f / 3.0f) * of[k].J) * b2[k]));
  }
#pragma unroll
  for (int k = 0; k < N; ++k) a[k] = fast_root(1.0001f * of[k].c1 + b2[k]);
  const auto evaluate = [&](int k) TISSUE_SIM_INLINE_LAMBDA {
    p[k] = a[k] * a[k] - of[k].c1;
    f1[k] = a[k] * p[k] - 2.0f * of[k].J;
    value4[k] = p[k] * p[k] - (j8[k] * a[k] + c24[k]);
  };
#pragma unroll
  for (int k = 0; k < N; ++k) {
    evaluate(k);
    f1[k] = fast_reciprocal(f1[k]);
  }
#pragma unroll
  for (int k = 0; k < N; ++k) a[k] -= 0.25f * value4[k] * f1[k];
#pragma unroll
  for (int k = 0; k < N; ++k) {
    evaluate(k);
    value4[k] *= 0.25f;
    const float d = f1[k] * f1[k] - value4[k] * (1.5f * p[k] + of[k].c1);
    value4[k] *= f1[k];
    f1[k] = fast_reciprocal(d);
  }
#pragma unroll
  for (int k = 0; k < N; ++k) {
    a[k] -= value4[k] * f1[k];
    p[k] = a[k] * a[k] - of[k].c1;
    f1[k] = a[k] * p[k] - 2.0f * of[k].J;
    b2[k] = fast_reciprocal(f1[k]);
  }
#pragma unroll
  for (int k = 0; k < N; ++k) {
    // P cancels where there is little strain: this reciprocal must be right to the last bit.
    s[k] = {a[k], 0.5f * p[k], nearer_reciprocal(b2[k], f1[k])};
  }
}
#endif

}  // namespace tissue_sim
