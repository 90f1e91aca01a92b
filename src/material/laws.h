// Hyperelastic laws: first Piola-Kirchhoff stress P(F) and energy density, for T = float (GPU),
// double (reference) or Vec<W> (CPU). Matrices are row-major arrays of 9: F[3 * i + k] = dx_i/dX_k.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

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

/// An upper bound of the square root of x >= 0, at most 9 % above it: a start for Newton's method.
TISSUE_SIM_INLINE double root_bound(double x) { return 1.04 * sqrt(x); }
/// By halving the exponent: for float and for vectors of floats, whose bits are integers of the
/// same width.
template <class T>
TISSUE_SIM_INLINE T root_bound(T x) {
  typename BitsOf<T>::type bits;
  std::memcpy(&bits, &x, sizeof(x));
  bits = (bits >> 1) + 0x1fbd1df5;
  std::memcpy(&x, &bits, sizeof(x));
  return 1.04f * x;
}

/// Cofactor matrix of F: cof F = J F^-T, defined for singular F too.
template <class T>
TISSUE_SIM_INLINE void cofactor(const T* F, T* cof) {
  cof[0] = F[4] * F[8] - F[5] * F[7];
  cof[1] = F[5] * F[6] - F[3] * F[8];
  cof[2] = F[3] * F[7] - F[4] * F[6];
  cof[3] = F[2] * F[7] - F[1] * F[8];
  cof[4] = F[0] * F[8] - F[2] * F[6];
  cof[5] = F[1] * F[6] - F[0] * F[7];
  cof[6] = F[1] * F[5] - F[2] * F[4];
  cof[7] = F[2] * F[3] - F[0] * F[5];
  cof[8] = F[0] * F[4] - F[1] * F[3];
}

template <class T>
TISSUE_SIM_INLINE T norm2(const T* A) {
  T s = A[0] * A[0];
  for (int i = 1; i < 9; ++i) s += A[i] * A[i];
  return s;
}

/// Invariants of the stretch U = sqrt(F^T F) of a deformation gradient, and what the rotation
/// follows from: R = ((b + c1) F - F C + a cof F) * inverse.
template <class T>
struct Stretch {
  T a;        ///< tr U (with the smallest stretch negative where det F < 0)
  T b;        ///< second invariant of U
  T c1;       ///< tr C = ||F||^2
  T inverse;  ///< 1 / (a b - J) = 1 / ((s1 + s2) (s2 + s3) (s3 + s1))
};

/// Solves (a^2 - tr C)^2 / 4 = ||cof F||^2 + 2 J a for its largest root a = tr U by Newton's method
/// (the quartic of Franca 1989; that R is the derivative of tr U is used by Lin, Chitalu and Komura
/// 2022) from above, where it converges monotonically: a^2 = tr C + 2 b and b^2 <= 3 ||cof F||^2.
/// The step divides by 2 (a b - J); its reciprocal is carried along and refined, for divisions are
/// dear. Relative error below 1e-6 for stretches between 1/3 and 3; finite for inverted F.
template <class T>
TISSUE_SIM_INLINE Stretch<T> stretch(T c1, T c2, T J) {
  T a = root_bound(c1 + 2.0f * root_bound(3.0f * c2));
  T p = a * a - c1;
  T slope = a * p - 2.0f * J;
  T r = 1.0f / slope;
  a -= (0.25f * p * p - c2 - 2.0f * J * a) * r;
  for (int i = 0; i < 4; ++i) {
    p = a * a - c1;
    slope = a * p - 2.0f * J;
    r = r * (2.0f - slope * r);
    a -= (0.25f * p * p - c2 - 2.0f * J * a) * r;
  }
  p = a * a - c1;
  slope = a * p - 2.0f * J;
  r = r * (2.0f - slope * r);
  r = r * (2.0f - slope * r);
  return {a, p * 0.5f, c1, r * 2.0f};
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

/// The same where roots and reciprocals are cheap: from b^2 = ||cof F||^2 + 2 J a with the bounds
/// sqrt(3 tr C) of a where J > 0 and sqrt(tr C / 3) where J < 0 comes a start that is too large by
/// 1.8 % at most where J > 0, so that three steps do; the 1e-4 keep the slope of a flat F from 0.
TISSUE_SIM_INLINE Stretch<float> stretch(float c1, float c2, float J) {
  const float j2 = 2.0f * J, j8 = 8.0f * J, c24 = 4.0f * c2;
  const float b2 = fast_root(fabsf(c24 + fmaxf(j8, (8.0f / 3.0f) * J) * fast_root(3.0f * c1)));
  float a = fast_root(1.0001f * c1 + b2), p;
#pragma unroll
  for (int i = 0; i < 3; ++i) {
    p = a * a - c1;
    a -= 0.25f * (p * p - (j8 * a + c24)) * fast_reciprocal(a * p - j2);
  }
  p = a * a - c1;
  // P cancels where there is little strain: this reciprocal must be right to the last bit.
  const float slope = a * p - j2, r = fast_reciprocal(slope);
  return {a, p * 0.5f, c1, 2.0f * (r + r * (1.0f - slope * r))};
}
#endif

/// C = F^T F: 00 11 22 01 02 12.
template <class T>
TISSUE_SIM_INLINE void right_cauchy_green(const T* F, T* C) {
  C[0] = F[0] * F[0] + F[3] * F[3] + F[6] * F[6];
  C[1] = F[1] * F[1] + F[4] * F[4] + F[7] * F[7];
  C[2] = F[2] * F[2] + F[5] * F[5] + F[8] * F[8];
  C[3] = F[0] * F[1] + F[3] * F[4] + F[6] * F[7];
  C[4] = F[0] * F[2] + F[3] * F[5] + F[6] * F[8];
  C[5] = F[1] * F[2] + F[4] * F[5] + F[7] * F[8];
}

/// F S for a symmetric S, ordered as C is.
template <class T>
TISSUE_SIM_INLINE void times_symmetric(const T* F, const T* S, T* FS) {
  for (int i = 0; i < 3; ++i) {
    FS[3 * i + 0] = F[3 * i] * S[0] + F[3 * i + 1] * S[3] + F[3 * i + 2] * S[4];
    FS[3 * i + 1] = F[3 * i] * S[3] + F[3 * i + 1] * S[1] + F[3 * i + 2] * S[5];
    FS[3 * i + 2] = F[3 * i] * S[4] + F[3 * i + 1] * S[5] + F[3 * i + 2] * S[2];
  }
}

/// Rotation of the polar decomposition F = R U (det R = 1).
template <class T>
TISSUE_SIM_INLINE void rotation(const T* F, T* R) {
  T cof[9], C[6], FC[9];
  cofactor(F, cof);
  const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
  const Stretch<T> s = stretch(norm2(F), norm2(cof), J);
  right_cauchy_green(F, C);
  times_symmetric(F, C, FC);
  for (int i = 0; i < 9; ++i) {
    R[i] = ((s.b + s.c1) * F[i] - FC[i] + s.a * cof[i]) * s.inverse;
  }
}

/// Fixed corotated (Stomakhin et al. 2012): psi = mu ||F - R||^2 + lambda/2 (J - 1)^2.
struct FixedCorotated {
  /// P = 2 mu (F - R) + lambda (J - 1) cof F. Give `mu` and `lambda` times a volume, and P is too.
  template <class T>
  TISSUE_SIM_INLINE static void stress(const T* F, T mu, T lambda, T* P) {
    T cof[9], C[6];
    cofactor(F, cof);
    right_cauchy_green(F, C);
    const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
    // ||cof F||^2 is the second invariant of C.
    const T c2 =
        (C[0] * C[1] - C[3] * C[3]) + (C[0] * C[2] - C[4] * C[4]) + (C[1] * C[2] - C[5] * C[5]);
    const Stretch<T> s = stretch(C[0] + C[1] + C[2], c2, J);
    const T mu2 = mu + mu;
    const T fc = mu2 * s.inverse;
    const T f = mu2 - fc * (s.b + s.c1);
    const T c = lambda * (J - 1.0f) - fc * s.a;
    // P = F (f I + fc C) + c cof F
    for (int i = 0; i < 6; ++i) C[i] = i < 3 ? fc * C[i] + f : fc * C[i];
    times_symmetric(F, C, P);
    for (int i = 0; i < 9; ++i) P[i] += c * cof[i];
  }

  /// Energy per volume; ||F - R||^2 = tr C - 2 tr U + 3.
  template <class T>
  TISSUE_SIM_INLINE static T energy(const T* F, T mu, T lambda) {
    T cof[9], R[9], d = mu * 0.0f;
    cofactor(F, cof);
    const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
    rotation(F, R);
    for (int i = 0; i < 9; ++i) d += (F[i] - R[i]) * (F[i] - R[i]);
    return mu * d + 0.5f * lambda * (J - 1.0f) * (J - 1.0f);
  }
};

/// Neo-Hookean that stays finite under inversion (Smith, de Goes, Kim 2018, eq. 13 without the log
/// term): psi = mu/2 (||F||^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2.
struct NeoHookean {
  /// P = mu F + ((lambda + mu) (J - 1) - mu) cof F.
  template <class T>
  TISSUE_SIM_INLINE static void stress(const T* F, T mu, T lambda, T* P) {
    T cof[9];
    cofactor(F, cof);
    const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
    const T c = (lambda + mu) * (J - 1.0f) - mu;
    for (int i = 0; i < 9; ++i) P[i] = mu * F[i] + c * cof[i];
  }

  template <class T>
  TISSUE_SIM_INLINE static T energy(const T* F, T mu, T lambda) {
    T cof[9];
    cofactor(F, cof);
    const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
    return 0.5f * mu * (norm2(F) - 3.0f) - mu * (J - 1.0f) +
           0.5f * (lambda + mu) * (J - 1.0f) * (J - 1.0f);
  }
};

/// Kelvin-Voigt viscosity: adds F S with S = 2 eta dE/dt, E Green's strain, to P.
template <class T>
TISSUE_SIM_INLINE void add_viscous_stress(const T* F, const T* Fdot, T eta, T* P) {
  T S[6];  // 00 11 22 01 02 12 of F^T Fdot + Fdot^T F = 2 dE/dt
  S[0] = 2.0f * (F[0] * Fdot[0] + F[3] * Fdot[3] + F[6] * Fdot[6]);
  S[1] = 2.0f * (F[1] * Fdot[1] + F[4] * Fdot[4] + F[7] * Fdot[7]);
  S[2] = 2.0f * (F[2] * Fdot[2] + F[5] * Fdot[5] + F[8] * Fdot[8]);
  S[3] = F[0] * Fdot[1] + F[3] * Fdot[4] + F[6] * Fdot[7] + F[1] * Fdot[0] + F[4] * Fdot[3] +
         F[7] * Fdot[6];
  S[4] = F[0] * Fdot[2] + F[3] * Fdot[5] + F[6] * Fdot[8] + F[2] * Fdot[0] + F[5] * Fdot[3] +
         F[8] * Fdot[6];
  S[5] = F[1] * Fdot[2] + F[4] * Fdot[5] + F[7] * Fdot[8] + F[2] * Fdot[1] + F[5] * Fdot[4] +
         F[8] * Fdot[7];
  for (int i = 0; i < 6; ++i) S[i] = S[i] * eta;
  for (int i = 0; i < 3; ++i) {
    P[3 * i + 0] += F[3 * i] * S[0] + F[3 * i + 1] * S[3] + F[3 * i + 2] * S[4];
    P[3 * i + 1] += F[3 * i] * S[3] + F[3 * i + 1] * S[1] + F[3 * i + 2] * S[5];
    P[3 * i + 2] += F[3 * i] * S[4] + F[3 * i + 1] * S[5] + F[3 * i + 2] * S[2];
  }
}

/// Von Mises stress of the Cauchy stress P F^T / J [Pa].
template <class T>
TISSUE_SIM_INLINE T von_mises_squared(const T* F, const T* P) {
  T cof[9], s[9];
  cofactor(F, cof);
  const T J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      s[3 * i + k] =
          P[3 * i] * F[3 * k] + P[3 * i + 1] * F[3 * k + 1] + P[3 * i + 2] * F[3 * k + 2];
    }
  }
  const T d0 = s[0] - s[4], d1 = s[4] - s[8], d2 = s[8] - s[0];
  const T shear = s[1] * s[1] + s[2] * s[2] + s[5] * s[5];
  return (0.5f * (d0 * d0 + d1 * d1 + d2 * d2) + 3.0f * shear) / (J * J);
}

}  // namespace tissue_sim
