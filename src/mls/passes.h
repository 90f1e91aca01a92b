// The passes over pairs, as templates on the width of a vector. For kernels.cpp alone.
//
//   H_i = sum_j w_ij (u_j - u_i) (x) M_i^-1 r_ij,   F_i = I + H_i
//   E   = sum_i V_i psi(F_i) + kappa_i / 2 sum_j w_ij |u_j - u_i - H_i r_ij|^2
//   f_i = sum_j w_ij [(Q_i + Q_j) r_ij + (kappa_i + kappa_j) (u_j - u_i)]
//   Q_i = V_i P(F_i) M_i^-1 - kappa_i H_i
//
// The second sum is the penalty of Ganzenmueller 2015, unprojected. H_i is the fit of least squares
// under the very weights of the penalty, so that what is left is normal to it and the derivative by
// H_i vanishes: forces are those of an energy, and the penalty costs nothing but kappa.
#pragma once

#include <cmath>

#include "material/laws.h"
#include "mls/kernels.h"
#include "mls/slot_passes.h"
#include "mls/stretch.h"

namespace tissue_sim {
namespace mls_passes {

/// sum_j w_ij (a_j - a_i) (x) r_ij of a chunk's nodes, into lanes: out[3 a + k] [kMlsChunk].
TISSUE_SIM_INLINE void moments_of_entries(const MlsField& f, const float* a, int chunk,
                                          float (&out)[9][kMlsChunk]) {
  const int first = chunk * kMlsChunk;
  for (int lane = 0; lane < kMlsChunk; ++lane) {
    const int i = first + lane;
    Vec<4> c0{}, c1{}, c2{};
    if (i < f.count) {
      const Vec<4> xi = load<4>(f.place + 4 * i), ai = load<4>(a + 4 * i);
      for (std::int32_t e = f.begin[i], end = f.begin[i + 1]; e < end; ++e) {
        const std::int32_t j = f.other[e];
        const Vec<4> r = (load<4>(f.place + 4 * j) - xi) * f.weight[e];
        const Vec<4> d = load<4>(a + 4 * j) - ai;
        c0 += d * r[0];
        c1 += d * r[1];
        c2 += d * r[2];
      }
    }
    for (int k = 0; k < 3; ++k) {
      out[3 * k][lane] = c0[k];
      out[3 * k + 1][lane] = c1[k];
      out[3 * k + 2][lane] = c2[k];
    }
  }
}

/// Of displacements or velocities: `a` is [4 nodes], `row` the first of the rows that hold it.
template <int W>
TISSUE_SIM_INLINE void moments_of(const MlsField& f, const float* a, int row, int chunk,
                                  float (&out)[9][kMlsChunk]) {
  if (goes_by_slots(f, chunk)) {
    moments_of_slots<W>(f, row, chunk, out);
  } else {
    moments_of_entries(f, a, chunk, out);
  }
}

/// A times the symmetric M^-1 of W nodes from `node` on.
template <int W>
TISSUE_SIM_INLINE void times_inverse_moment(const MlsField& f, int node, const Vec<W>* A,
                                            Vec<W>* out) {
  Vec<W> m[6];
  for (int k = 0; k < 6; ++k) m[k] = load<W>(f.inverse_moment[k] + node);
  times_symmetric(A, m, out);
}

/// Deformation gradients of W lanes, and H.
template <int W>
TISSUE_SIM_INLINE void gradients(const MlsField& f, int node, const float (&moments)[9][kMlsChunk],
                                 int lane, Vec<W> (&H)[9]) {
  Vec<W> A[9];
  for (int k = 0; k < 9; ++k) A[k] = load<W>(&moments[k][lane]);
  times_inverse_moment<W>(f, node, A, H);
}

/// All bits set in lanes whose byte is not 0.
template <int W>
TISSUE_SIM_INLINE Mask<W> mask_of(const std::uint8_t* bytes, bool& any, bool& all) {
  Mask<W> mask{};
  any = false, all = true;
  for (int l = 0; l < W; ++l) {
    mask[l] = bytes[l] != 0 ? -1 : 0;
    any = any || bytes[l] != 0;
    all = all && bytes[l] != 0;
  }
  return mask;
}

/// Stress times volume of W nodes.
template <int W>
TISSUE_SIM_INLINE void stress_of(const MlsField& f, int node, const Vec<W> (&F)[9],
                                 Vec<W> (&P)[9]) {
  const Vec<W> mu = load<W>(f.volume_mu + node), lambda = load<W>(f.volume_lambda + node);
  bool any, all;
  const Mask<W> neo = mask_of<W>(f.neo_hookean + node, any, all);
  if (!all) stress<FixedCorotated>(F, mu, lambda, P);
  if (!any) return;
  Vec<W> N[9];
  stress<NeoHookean>(F, mu, lambda, N);
  for (int k = 0; k < 9; ++k) P[k] = all ? N[k] : either<W>(neo, N[k], P[k]);
}

template <int W>
TISSUE_SIM_INLINE void stresses(const MlsField& f, int chunk) {
  alignas(64) float moments[9][kMlsChunk], rates[9][kMlsChunk];
  moments_of<W>(f, f.u, kMlsURow, chunk, moments);
  if (f.viscous) moments_of<W>(f, f.v, kMlsVRow, chunk, rates);
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    const int node = chunk * kMlsChunk + lane;
    Vec<W> H[9], F[9], P[9], Q[9];
    gradients<W>(f, node, moments, lane, H);
    for (int k = 0; k < 9; ++k) F[k] = k % 4 == 0 ? H[k] + 1.0f : H[k];
    if (f.touching != nullptr && f.touching[chunk] != 0) {
      for (int k = 0; k < 9; ++k) {
        store<W>(f.deformation + (9 * static_cast<std::size_t>(chunk) + k) * kMlsChunk + lane,
                 F[k]);
      }
    }
    stress_of<W>(f, node, F, P);
    if (f.viscous) {
      Vec<W> rate[9];
      gradients<W>(f, node, rates, lane, rate);
      add_viscous_stress(F, rate, load<W>(f.volume_eta + node), P);
    }
    times_inverse_moment<W>(f, node, P, Q);
    const Vec<W> kappa = load<W>(f.kappa + node);
    alignas(64) float lanes[9][W];
    for (int k = 0; k < 9; ++k) {
      const Vec<W> q = Q[k] - kappa * H[k];
      if (f.any_slots) store<W>(f.rows + (kMlsStressRow + k) * f.stride + node, q);
      store<W>(lanes[k], q);
    }
    if (f.any_slots) store<W>(f.rows + kMlsKappaRow * f.stride + node, kappa);
    for (int l = 0; l < W && f.any_entries; ++l) {
      float* out = f.stress + 16 * static_cast<std::size_t>(node + l);
      for (int k = 0; k < 3; ++k) {  // columns
        const Vec<4> column = {lanes[k][l], lanes[3 + k][l], lanes[6 + k][l],
                               k == 0 ? f.kappa[node + l] : 0.0f};
        store<4>(out + 4 * k, column);
      }
    }
  }
}

TISSUE_SIM_INLINE void force(const MlsField& f, int i, float* out) {
  const float* own = f.stress + 16 * static_cast<std::size_t>(i);
  const Vec<4> xi = load<4>(f.place + 4 * i), ui = load<4>(f.u + 4 * i);
  const Vec<4> q0 = load<4>(own), q1 = load<4>(own + 4), q2 = load<4>(own + 8);
  Vec<4> sum{};
  for (std::int32_t e = f.begin[i], end = f.begin[i + 1]; e < end; ++e) {
    const std::int32_t j = f.other[e];
    const float* q = f.stress + 16 * static_cast<std::size_t>(j);
    const Vec<4> r = load<4>(f.place + 4 * j) - xi, d = load<4>(f.u + 4 * j) - ui;
    const Vec<4> a0 = q0 + load<4>(q), a1 = q1 + load<4>(q + 4), a2 = q2 + load<4>(q + 8);
    sum += f.weight[e] * (a0 * r[0] + a1 * r[1] + (a2 * r[2] + d * a0[3]));
  }
  sum[3] = 0;
  store<4>(out, sum);
}

template <int W>
TISSUE_SIM_INLINE void forces(const MlsField& f, int chunk, float* out) {
  if (goes_by_slots(f, chunk)) {
    forces_of_slots<W>(f, chunk, out);
    return;
  }
  const int first = chunk * kMlsChunk;
  for (int lane = 0; lane < kMlsChunk; ++lane) {
    if (first + lane < f.count) force(f, first + lane, out + 4 * lane);
  }
}

TISSUE_SIM_INLINE void residuals_of_entries(const MlsField& f, int chunk,
                                            const float (&H)[9][kMlsChunk],
                                            float (&out)[kMlsChunk]) {
  for (int lane = 0; lane < kMlsChunk; ++lane) {
    const int i = chunk * kMlsChunk + lane;
    out[lane] = 0;
    if (i >= f.count) continue;
    const Vec<4> h0 = {H[0][lane], H[3][lane], H[6][lane], 0},
                 h1 = {H[1][lane], H[4][lane], H[7][lane], 0},
                 h2 = {H[2][lane], H[5][lane], H[8][lane], 0};
    const Vec<4> xi = load<4>(f.place + 4 * i), ui = load<4>(f.u + 4 * i);
    for (std::int32_t e = f.begin[i], end = f.begin[i + 1]; e < end; ++e) {
      const std::int32_t j = f.other[e];
      const Vec<4> r = load<4>(f.place + 4 * j) - xi;
      const Vec<4> d = load<4>(f.u + 4 * j) - ui - (h0 * r[0] + h1 * r[1] + h2 * r[2]);
      out[lane] += f.weight[e] * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    }
  }
}

template <int W>
TISSUE_SIM_INLINE MlsMeasure measure(const MlsField& f, int chunk, float* von_mises,
                                     float* stiffening) {
  alignas(64) float moments[9][kMlsChunk], fits[9][kMlsChunk], residuals[kMlsChunk];
  moments_of<W>(f, f.u, kMlsURow, chunk, moments);
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    Vec<W> H[9];
    gradients<W>(f, chunk * kMlsChunk + lane, moments, lane, H);
    for (int k = 0; k < 9; ++k) store<W>(&fits[k][lane], H[k]);
  }
  if (goes_by_slots(f, chunk)) {
    residuals_of_slots<W>(f, chunk, fits, residuals);
  } else {
    residuals_of_entries(f, chunk, fits, residuals);
  }
  MlsMeasure result;
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    const int node = chunk * kMlsChunk + lane;
    Vec<W> F[9], cof[9];
    for (int k = 0; k < 9; ++k) {
      F[k] = load<W>(&fits[k][lane]);
      if (k % 4 == 0) F[k] += 1.0f;
    }
    const Vec<W> mu = load<W>(f.volume_mu + node), lambda = load<W>(f.volume_lambda + node);
    Vec<W> fixed = energy<FixedCorotated>(F, mu, lambda);
    const Vec<W> neo = energy<NeoHookean>(F, mu, lambda);
    cofactor(F, cof);
    Vec<W> columns[3], mises{};
    const Vec<W> stretch2 = most_stretch2(F);
    for (int k = 0; k < 3; ++k) {
      columns[k] = cof[k] * cof[k] + cof[3 + k] * cof[3 + k] + cof[6 + k] * cof[6 + k];
    }
    if (von_mises != nullptr) {
      Vec<W> P[9];
      stress_of<W>(f, node, F, P);
      mises = von_mises_squared(F, P);
    }
    for (int l = 0; l < W && node + l < f.count; ++l) {
      const double e = f.neo_hookean[node + l] != 0 ? neo[l] : fixed[l];
      result.elastic += e + 0.5 * f.kappa[node + l] * residuals[lane + l];
      const float most = fmaxf(1.0f, fmaxf(columns[0][l], fmaxf(columns[1][l], columns[2][l])));
      const bool finite =
          std::isfinite(e) && std::isfinite(columns[0][l] + columns[1][l] + columns[2][l]);
      result.finite = result.finite && finite;
      result.stretch2 = fmaxf(result.stretch2, stretch2[l]);
      if (stiffening != nullptr) stiffening[lane + l] = finite ? most : INFINITY;
      if (von_mises != nullptr) {
        const float volume = f.volume_mu[node + l];  // V mu: the caller knows mu
        von_mises[lane + l] = volume > 0 ? sqrtf(fmaxf(0.0f, mises[l])) / volume : 0.0f;
      }
    }
  }
  return result;
}

}  // namespace mls_passes
}  // namespace tissue_sim
