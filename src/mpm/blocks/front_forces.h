// Forces and energy of the cells at the front of a cut. For block_kernels.cpp alone.
//
// With the shares s_1 >= s_2 >= ... of a cell's parted nodes, its energy is
//   (1 - s_1) E_0 + (s_1 - s_2) E_1 + (s_2 - s_3) E_2 + ...,
// E_j that of its points where the first j of them are parted and the others are not: it goes from
// E_0, which the block has, to that of the cut without a jump, whichever node comes first.
#pragma once

#include <cmath>

#include "material/laws.h"
#include "mpm/blocks/front_cell.h"
#include "mpm/blocks/stabilise_cell.h"

namespace tissue_sim {
namespace kernels {

/// Slopes of the 27 weights of a cell at its eight points, times the cell size.
struct CellSlopes {
  alignas(64) float at_points[27][3][8];
  alignas(64) float of_nodes[8][3][32];
  constexpr CellSlopes() : at_points(), of_nodes() {
    for (int k = 0; k < 27; ++k) {
      const int d[3] = {k % 3, k / 3 % 3, k / 9};
      for (int p = 0; p < 8; ++p) {
        for (int axis = 0; axis < 3; ++axis) {
          float value = 1;
          for (int a = 0; a < 3; ++a) {
            const int s = p >> a & 1;
            value *= a == axis ? slope(s, d[a]) : lattice_weight(s, d[a]);
          }
          at_points[k][axis][p] = of_nodes[p][axis][k] = value;
        }
      }
    }
  }
  static constexpr float slope(int s, int d) {
    if (d == 1) return s == 1 ? -0.5f : 0.5f;
    return (d == 2 ? 1.0f : -1.0f) * ((d == 2) == (s == 1) ? 0.75f : 0.25f);
  }
};
inline constexpr CellSlopes kCellSlopes;

/// Adds to G[9] the gradient of a field that is `value`[3] at node k and 0 at the others.
TISSUE_SIM_INLINE void add_gradient(const float* value, int k, Vec<8>* G) {
  for (int axis = 0; axis < 3; ++axis) {
    const Vec<8> slope = load<8>(kCellSlopes.at_points[k][axis]);
    for (int c = 0; c < 3; ++c) G[3 * c + axis] += value[c] * slope;
  }
}

/// Gradient of a node field over cell size at the points of a cell.
TISSUE_SIM_INLINE void front_gradient(const FrontCell& cell, const float* const (&field)[3],
                                      Vec<8>* G) {
  for (int i = 0; i < 9; ++i) G[i] = Vec<8>{};
  for (int k = 0; k < 27; ++k) {
    const std::int32_t n = cell.node[k];
    const float value[3] = {cell.inverse_size * field[0][n], cell.inverse_size * field[1][n],
                            cell.inverse_size * field[2][n]};
    add_gradient(value, k, G);
  }
}

/// Adds to it what a parted node has more.
TISSUE_SIM_INLINE void add_part(const FrontCell& cell, const FrontPart& part,
                                const float* const (&field)[3], Vec<8>* G) {
  const float by = cell.inverse_size * part.side;
  const float value[3] = {by * field[0][part.node], by * field[1][part.node],
                          by * field[2][part.node]};
  add_gradient(value, part.k, G);
}

TISSUE_SIM_INLINE float sum_of(Vec<8> v) {
  float of[8];
  store<8>(of, v);
  const Vec<4> half = load<4>(of) + load<4>(of + 4);
  return (half[0] + half[1]) + (half[2] + half[3]);
}

/// F at the points of the cell, 1 where it has none: what is far from them may be no number there.
TISSUE_SIM_INLINE void front_F(const Vec<8>* G, Mask<8> there, Vec<8>* F) {
  for (int i = 0; i < 9; ++i) F[i] = keep<8>(there, G[i]) + (i % 4 == 0 ? 1.0f : 0.0f);
}

/// Stress of the eight points times their volumes, with the viscous one of the mean gradient.
template <class LawOf>
TISSUE_SIM_INLINE void front_stress(const FrontCell& cell, const Vec<8>* G, const Vec<8>* rate,
                                    float viscosity, Vec<8>* P) {
  const Vec<8> mu = load<8>(cell.mu), lambda = load<8>(cell.lambda);
  Vec<8> F[1][9], stress[1][9];
  front_F(G, -bits<8>(mu) >> 31, F[0]);
  LawOf::template stresses<1>(F, &mu, &lambda, stress);
  for (int i = 0; i < 9; ++i) P[i] = stress[0][i];
  if (!(viscosity > 0)) return;
  float mean[9], mean_rate[9], viscous[9] = {};
  for (int i = 0; i < 9; ++i) {
    mean[i] = 0.125f * sum_of(G[i]) + (i % 4 == 0 ? 1.0f : 0.0f);
    mean_rate[i] = 0.125f * sum_of(rate[i]);
  }
  add_viscous_stress(mean, mean_rate, 0.125f * viscosity, viscous);
  for (int i = 0; i < 9; ++i) P[i] += viscous[i];
}

/// Force on the parted nodes of what resists motion without strain: stabilisation.h, of d alone.
/// Returns the energy.
TISSUE_SIM_INLINE double stabilise_parts(const FrontCell& cell, const FrontField& f, float* pull) {
  constexpr int kRoom = 32;
  float d[3][kRoom] = {}, force[3][kRoom] = {};
  const FrontPart* parts = f.parts + cell.first;
  for (int i = 0; i < cell.count; ++i) {
    const float by = std::sqrt(parts[i].share) * parts[i].side * cell.inverse_size;
    for (int c = 0; c < 3; ++c) d[c][parts[i].k] = by * f.d[c][parts[i].node];
  }
  double twice_energy = 0;
  for (int c = 0; c < 3; ++c) {
    twice_energy += stabilise<4>(cell.stabilised, d[c], kRoom, 3, 9, force[c], kRoom);
  }
  if (pull == nullptr) return 0.5 * twice_energy;
  for (int i = 0; i < cell.count; ++i) {
    const float by = std::sqrt(parts[i].share) * parts[i].side * cell.inverse_size;
    for (int c = 0; c < 3; ++c) pull[4 * i + c] -= by * force[c][parts[i].k];
  }
  return 0.5 * twice_energy;
}

/// What a cell's force is more than the block's: on its nodes, [27][4], and on d of its parts,
/// [count][4]. [N]
template <class LawOf>
TISSUE_SIM_INLINE void front_forces(const FrontCell& cell, const FrontField& f, float* force,
                                    float* pull) {
  const FrontPart* parts = f.parts + cell.first;
  const bool viscous = cell.viscosity[0] > 0;
  Vec<8> G[9], rate[9], P[9], sum[9], before[27][9];
  front_gradient(cell, f.u, G);
  if (viscous) front_gradient(cell, f.v, rate);
  front_stress<LawOf>(cell, G, rate, cell.viscosity[0], P);
  for (int i = 0; i < 9; ++i) sum[i] = -parts[0].share * P[i];
  for (int j = 0; j < cell.count; ++j) {
    for (int i = 0; i < 9; ++i) before[j][i] = sum[i];  // of what node j is not parted in
    add_part(cell, parts[j], f.d, G);
    if (viscous) add_part(cell, parts[j], f.rate, rate);
    if (!(parts[j].step > 0)) continue;
    front_stress<LawOf>(cell, G, rate, cell.viscosity[1], P);
    for (int i = 0; i < 9; ++i) sum[i] += parts[j].step * P[i];
  }
  for (int j = 0; j < cell.count; ++j) {
    const float by = -cell.inverse_size * parts[j].side;
    for (int c = 0; c < 3; ++c) {
      Vec<8> of_lanes = {};
      for (int axis = 0; axis < 3; ++axis) {
        of_lanes += (sum[3 * c + axis] - before[j][3 * c + axis]) *
                    load<8>(kCellSlopes.at_points[parts[j].k][axis]);
      }
      pull[4 * j + c] = by * sum_of(of_lanes);
    }
  }
  float stress_of[9][8], component[3][32];
  for (int i = 0; i < 9; ++i) store<8>(stress_of[i], -cell.inverse_size * sum[i]);
  for (int c = 0; c < 3; ++c) {
    Vec<8> of_nodes[4] = {};
    for (int axis = 0; axis < 3; ++axis) {
      for (int p = 0; p < 8; ++p) {
        const float stress = stress_of[3 * c + axis][p];
        for (int n = 0; n < 4; ++n) {
          of_nodes[n] += stress * load<8>(kCellSlopes.of_nodes[p][axis] + 8 * n);
        }
      }
    }
    for (int n = 0; n < 4; ++n) store<8>(component[c] + 8 * n, of_nodes[n]);
  }
  for (int k = 0; k < 27; ++k) {
    for (int c = 0; c < 3; ++c) force[4 * k + c] = component[c][k];
  }
  if (cell.stabilised > 0) stabilise_parts(cell, f, pull);
}

/// The same energy [J].
template <class LawOf>
TISSUE_SIM_INLINE double front_energy(const FrontCell& cell, const FrontField& f) {
  const FrontPart* parts = f.parts + cell.first;
  const Vec<8> mu = load<8>(cell.mu), lambda = load<8>(cell.lambda);
  const Mask<8> there = -bits<8>(mu) >> 31;
  Vec<8> G[9], F[1][9], energy;
  front_gradient(cell, f.u, G);
  front_F(G, there, F[0]);
  LawOf::template energies<1>(F, &mu, &lambda, &energy);
  double sum = -static_cast<double>(parts[0].share) * sum_of(energy);
  for (int j = 0; j < cell.count; ++j) {
    add_part(cell, parts[j], f.d, G);
    if (!(parts[j].step > 0)) continue;
    front_F(G, there, F[0]);
    LawOf::template energies<1>(F, &mu, &lambda, &energy);
    sum += static_cast<double>(parts[j].step) * sum_of(energy);
  }
  return cell.stabilised > 0 ? sum + stabilise_parts(cell, f, nullptr) : sum;
}

TISSUE_SIM_INLINE void front_forces_any(const FrontCell& cell, const FrontField& f, float* force,
                                        float* pull) {
  if (cell.law == Law::kNeoHookean) return front_forces<NeoHookean>(cell, f, force, pull);
  front_forces<FixedCorotated>(cell, f, force, pull);
}
TISSUE_SIM_INLINE double front_energy_any(const FrontCell& cell, const FrontField& f) {
  return cell.law == Law::kNeoHookean ? front_energy<NeoHookean>(cell, f)
                                      : front_energy<FixedCorotated>(cell, f);
}

}  // namespace kernels
}  // namespace tissue_sim
