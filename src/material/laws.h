// Hyperelastic laws: first Piola-Kirchhoff stress P(F) and energy density, for T = float (GPU),
// double (reference) or Vec<W> (CPU). Matrices are row-major arrays of 9: F[3 * i + k] = dx_i/dX_k.
#pragma once

#include "compute/host_device.h"
#include "material/stretch.h"

namespace tissue_sim {

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

/// Rotations of the polar decompositions F = R U (det R = 1) of N points.
template <int N, class T>
TISSUE_SIM_INLINE void rotations(const T (*F)[9], T (*R)[9]) {
  Invariants<T> of[N];
  Stretch<T> s[N];
  for (int k = 0; k < N; ++k) {
    T cof[9];
    cofactor(F[k], cof);
    of[k] = {norm2(F[k]), norm2(cof), F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2]};
  }
  stretch<N>(of, s);
  for (int k = 0; k < N; ++k) {
    T cof[9], C[6], FC[9];
    cofactor(F[k], cof);
    right_cauchy_green(F[k], C);
    times_symmetric(F[k], C, FC);
    const T two = s[k].inverse_slope + s[k].inverse_slope;
    for (int i = 0; i < 9; ++i) {
      R[k][i] = ((s[k].b + of[k].c1) * F[k][i] - FC[i] + s[k].a * cof[i]) * two;
    }
  }
}

/// That of one point: F[9] -> R[9].
template <class T>
TISSUE_SIM_INLINE void rotation(const T* F, T* R) {
  rotations<1>(reinterpret_cast<const T(*)[9]>(F), reinterpret_cast<T(*)[9]>(R));
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
      of[k] = {C[0] + C[1] + C[2],
               C[0] * (C[1] + C[2]) + (C[1] * C[2] - C[3] * C[3] - C[4] * C[4] - C[5] * C[5]),
               F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2]};
    }
    stretch<N>(of, s);
    for (int k = 0; k < N; ++k) {  // cof F and C anew: to keep them for N points costs more
      T cof[9], C[6], FC[9];
      cofactor(F[k], cof);
      right_cauchy_green(F[k], C);
      const T mu2 = mu[k] + mu[k], mu4 = mu2 + mu2;
      // b + tr C is 6 and a is 3 where F = I: written so, all three numbers have the rounding of
      // 3 fc there and cancel, without fused multiply-add too.
      const T fc = mu4 * s[k].inverse_slope;
      const T f = (mu2 - 4.0f * fc) - fc * (s[k].b + of[k].c1 - 4.0f);
      const T c = lambda[k] * (of[k].J - 1.0f) - fc * s[k].a;
      // P = F (f I + fc C) + c cof F
      for (int i = 0; i < 6; ++i) C[i] = i < 3 ? fc * C[i] + f : fc * C[i];
      times_symmetric(F[k], C, FC);
      for (int i = 0; i < 9; ++i) P[k][i] = FC[i] + c * cof[i];
    }
  }

  /// Energies per volume of N points, with as many `mu` and `lambda`.
  template <int N, class T>
  TISSUE_SIM_INLINE static void energies(const T (*F)[9], const T* mu, const T* lambda, T* energy) {
    T R[N][9];
    rotations<N>(F, R);
    for (int k = 0; k < N; ++k) {
      T cof[9];
      cofactor(F[k], cof);
      const T J = F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2];
      for (int i = 0; i < 9; ++i) R[k][i] = F[k][i] - R[k][i];
      energy[k] = mu[k] * norm2(R[k]) + 0.5f * lambda[k] * (J - 1.0f) * (J - 1.0f);
    }
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

  template <int N, class T>
  TISSUE_SIM_INLINE static void energies(const T (*F)[9], const T* mu, const T* lambda, T* energy) {
    for (int k = 0; k < N; ++k) {
      T cof[9];
      cofactor(F[k], cof);
      const T J = F[k][0] * cof[0] + F[k][1] * cof[1] + F[k][2] * cof[2];
      energy[k] = 0.5f * mu[k] * (norm2(F[k]) - 3.0f) - mu[k] * (J - 1.0f) +
                  0.5f * (lambda[k] + mu[k]) * (J - 1.0f) * (J - 1.0f);
    }
  }
};

/// stresses() of one point: F[9] -> P[9].
template <class LawOf, class T>
TISSUE_SIM_INLINE void stress(const T* F, T mu, T lambda, T* P) {
  LawOf::template stresses<1>(reinterpret_cast<const T(*)[9]>(F), &mu, &lambda,
                              reinterpret_cast<T(*)[9]>(P));
}

/// energies() of one point.
template <class LawOf, class T>
TISSUE_SIM_INLINE T energy(const T* F, T mu, T lambda) {
  T of_point;
  LawOf::template energies<1>(reinterpret_cast<const T(*)[9]>(F), &mu, &lambda, &of_point);
  return of_point;
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
