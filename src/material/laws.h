// Hyperelastic laws: first Piola-Kirchhoff stress P(F) and energy density, for T = float (GPU),
// double (reference) or Vec<W> (CPU). Matrices are row-major arrays of 9: F[3 * i + k] = dx_i/dX_k.
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

/// Invariants of C = F^T F and det F.
template <class T>
struct Invariants {
  T c1;  ///< tr C = ||F||^2
  T c2;  ///< second invariant of C, ||cof F||^2
  T J;   ///< det F
};

/// Invariants of the stretch U = sqrt(F^T F) of a deformation gradient, and what the rotation
/// follows from: R = ((b + c1) F - F C + a cof F) * inverse.
template <class T>
struct Stretch {
  T a;        ///< tr U (with the smallest stretch negative where det F < 0)
  T b;        ///< second invariant of U
  T inverse;  ///< 1 / (a b - J) = 1 / ((s1 + s2) (s2 + s3) (s3 + s1))
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
    r[k] = nearer_reciprocal(nearer_reciprocal(r[k], f.slope), f.slope);
    s[k] = {a[k], 0.5f * f.p, r[k] + r[k]};
  }
}

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
  const Invariants<T> of = {norm2(F), norm2(cof), J};
  Stretch<T> s;
  stretch<1>(&of, &s);
  right_cauchy_green(F, C);
  times_symmetric(F, C, FC);
  for (int i = 0; i < 9; ++i) {
    R[i] = ((s.b + of.c1) * F[i] - FC[i] + s.a * cof[i]) * s.inverse;
  }
}

/// Fixed corotated (Stomakhin et al. 2012): psi = mu ||F - R||^2 + lambda/2 (J - 1)^2.
struct FixedCorotated {
  /// P = 2 mu (F - R) + lambda (J - 1) cof F of N points. Give `mu` and `lambda` times a volume,
  /// and P is too. F and P may be the same.
  template <int N, class T>
  TISSUE_SIM_INLINE static void stresses(const T (*F)[9], const T* mu, const T* lambda, T (*P)[9]) {
    Invariants<T> of[N];
    Stretch<T> s[N];
    for (int k = 0; k < N; ++k) {
      T cof[9], C[6];
      cofactor(F[k], cof);
      right_cauchy_green(F[k], C);
      of[k] = {
          C[0] + C[1] + C[2],
          (C[0] * C[1] - C[3] * C[3]) + (C[0] * C[2] - C[4] * C[4]) + (C[1] * C[2] - C[5] * C[5]),
          F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2]};
    }
    stretch<N>(of, s);
    for (int k = 0; k < N; ++k) {  // cof F and C anew: to keep them for N points costs more
      T cof[9], C[6], FC[9];
      cofactor(F[k], cof);
      right_cauchy_green(F[k], C);
      const T mu2 = mu[k] + mu[k];
      // The moduli come last, so that no rounding of theirs is left where F = I: tissue at rest
      // stays there without fused multiply-add, too.
      const T fc = mu2 * s[k].inverse;
      const T f = mu2 * (1.0f - s[k].inverse * (s[k].b + of[k].c1));
      const T c = lambda[k] * (of[k].J - 1.0f) - mu2 * (s[k].inverse * s[k].a);
      // P = F (f I + fc C) + c cof F
      for (int i = 0; i < 6; ++i) C[i] = i < 3 ? fc * C[i] + f : fc * C[i];
      times_symmetric(F[k], C, FC);
      for (int i = 0; i < 9; ++i) P[k][i] = FC[i] + c * cof[i];
    }
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
  /// P = mu F + ((lambda + mu) (J - 1) - mu) cof F of N points. As FixedCorotated's.
  template <int N, class T>
  TISSUE_SIM_INLINE static void stresses(const T (*F)[9], const T* mu, const T* lambda, T (*P)[9]) {
    for (int k = 0; k < N; ++k) {
      T cof[9];
      cofactor(F[k], cof);
      const T J = F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2];
      const T c = (lambda[k] + mu[k]) * (J - 1.0f) - mu[k];
      for (int i = 0; i < 9; ++i) P[k][i] = mu[k] * F[k][i] + c * cof[i];
    }
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

/// stresses() of one point: F[9] -> P[9].
template <class LawOf, class T>
TISSUE_SIM_INLINE void stress(const T* F, T mu, T lambda, T* P) {
  LawOf::template stresses<1>(reinterpret_cast<const T(*)[9]>(F), &mu, &lambda,
                              reinterpret_cast<T(*)[9]>(P));
}

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
