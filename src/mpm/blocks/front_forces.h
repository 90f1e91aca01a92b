// Forces and energy of the cells at the front of a cut (front_stress.h), the eight points of one
// side by side. For block_kernels.cpp alone.
#pragma once

#include <cmath>

#include "mpm/blocks/front_stress.h"
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

/// The eight points of a cell: front_stress.h.
struct FrontPoints {
  using T = Vec<8>;
  const FrontCell& cell;
  const FrontField& field;
  float* pulls;  // null where nothing asks for them

  TISSUE_SIM_INLINE const FrontPart& part(int j) const { return field.parts[cell.first + j]; }
  TISSUE_SIM_INLINE Vec<8> slope(int k, int axis) const {
    return load<8>(kCellSlopes.at_points[k][axis]);
  }
  TISSUE_SIM_INLINE Vec<8> mu() const { return load<8>(cell.mu); }
  TISSUE_SIM_INLINE Vec<8> lambda() const { return load<8>(cell.lambda); }
  TISSUE_SIM_INLINE Vec<8> keep(Vec<8> x) const {
    return tissue_sim::keep<8>(-bits<8>(load<8>(cell.mu)) >> 31, x);
  }
  TISSUE_SIM_INLINE float sum(Vec<8> x) const {
    float of[8];
    store<8>(of, x);
    const Vec<4> half = load<4>(of) + load<4>(of + 4);
    return (half[0] + half[1]) + (half[2] + half[3]);
  }
  template <bool kRate>
  TISSUE_SIM_INLINE void node(std::int32_t n, float (&x)[3]) const {
    for (int c = 0; c < 3; ++c) x[c] = (kRate ? field.v : field.u)[c][n];
  }
  template <bool kRate>
  TISSUE_SIM_INLINE void parted(std::int32_t n, float (&x)[3]) const {
    for (int c = 0; c < 3; ++c) x[c] = (kRate ? field.rate : field.d)[c][n];
  }
  TISSUE_SIM_INLINE void pull(int j, int c, float force) const { pulls[4 * j + c] = force; }
};

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
  Vec<8> sum[9];
  front::stresses<LawOf>(FrontPoints{cell, f, pull}, sum);
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
  const double sum = front::energy<LawOf>(FrontPoints{cell, f, nullptr});
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
