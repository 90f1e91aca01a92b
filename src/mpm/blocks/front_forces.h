// Forces and energy of the cells at the front of a cut (front_stress.h), the eight points of one
// side by side. For kernel_set.h alone.
#pragma once

#include <algorithm>
#include <cmath>

#include "mpm/blocks/front_stress.h"
#include "mpm/blocks/stabilise_cell.h"

namespace tissue_sim {
namespace kernels {

/// Slopes of the 27 weights of a cell at its eight points, and in their mean, times the cell size.
struct CellSlopes {
  alignas(64) float at_points[27][3][8];
  alignas(64) float of_nodes[8][3][32];
  alignas(64) float mean[27][4];
  constexpr CellSlopes() : at_points(), of_nodes(), mean() {
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
          mean[k][axis] += 0.125f * value;
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
};

/// Mean gradient of a field over a cell's points: what viscosity acts on.
struct MeanGradient {
  Vec<4> of[3] = {};  ///< along the axes, by component

  TISSUE_SIM_INLINE void add(const float (&value)[3], int k) {
    const Vec<4> slope = load<4>(kCellSlopes.mean[k]);
    for (int c = 0; c < 3; ++c) of[c] += value[c] * slope;
  }
  TISSUE_SIM_INLINE void store(float diagonal, float (&to)[9]) const {
    for (int i = 0; i < 9; ++i) to[i] = of[i / 3][i % 3] + (i % 4 == 0 ? diagonal : 0.0f);
  }
};

/// Three sums over the points of a cell.
TISSUE_SIM_INLINE Vec<4> sums(const Vec<8> (&x)[3]) {
  Vec<4> half[3];
  for (int c = 0; c < 3; ++c) {
    float of[8];
    store<8>(of, x[c]);
    half[c] = load<4>(of) + load<4>(of + 4);
  }
  const auto lane = [&half](int i) TISSUE_SIM_INLINE_LAMBDA {
    return Vec<4>{half[0][i], half[1][i], half[2][i], 0.0f};
  };
  return (lane(0) + lane(1)) + (lane(2) + lane(3));
}

/// Stresses of a cell's points, times their volumes, summed up with how much of its energy is that
/// with the first nodes parted. Several are worked out side by side: each step towards one waits
/// for the step before.
template <class LawOf>
class FrontStresses {
 public:
  explicit FrontStresses(const FrontPoints& points) : points_(points) {}

  /// Adds that at a gradient, and a viscous one that all points have.
  TISSUE_SIM_INLINE void add(const Vec<8> (&G)[9], front::Weights weights,
                             const float (&viscous)[9]) {
    front::deformation(points_, G, F_[waiting_]);
    weights_[waiting_] = weights;
    std::copy_n(viscous, 9, viscous_[waiting_]);
    if (++waiting_ == kTogether) work_out<kTogether>();
  }
  TISSUE_SIM_INLINE void work_out_rest() {
    if (waiting_ == 1) work_out<1>();
    if (waiting_ == 2) work_out<2>();
    if (waiting_ == 3) work_out<kTogether>();
  }
  int count() const { return count_ + waiting_; }
  /// The sum of the first so many.
  const Vec<8> (&sum(int count) const)[9] { return sum_[count]; }

 private:
  static constexpr int kTogether = 4;

  template <int N>
  TISSUE_SIM_INLINE void work_out() {
    Vec<8> mu[N], lambda[N];
    for (int i = 0; i < N; ++i) {
      front::weigh(points_, weights_[std::min(i, waiting_ - 1)], mu[i], lambda[i]);
    }
    for (int n = waiting_; n < N; ++n) std::copy_n(F_[0], 9, F_[n]);
    Vec<8> P[N][9];
    LawOf::template stresses<N>(F_, mu, lambda, P);
    for (int n = 0; n < waiting_; ++n, ++count_) {
      for (int i = 0; i < 9; ++i) {
        const Vec<8> before = count_ == 0 ? Vec<8>{} : sum_[count_][i];
        sum_[count_ + 1][i] = before + P[n][i] + weights_[n].shape * viscous_[n][i];
      }
    }
    waiting_ = 0;
  }

  const FrontPoints& points_;
  int waiting_ = 0, count_ = 0;
  Vec<8> F_[kTogether][9], sum_[29][9];
  front::Weights weights_[kTogether];
  float viscous_[kTogether][9];
};

/// What a cell's stress, times volumes, is more than the block's, and the force on the parts that
/// belongs to it.
template <class LawOf>
TISSUE_SIM_INLINE void front_stresses(const FrontPoints& p, Vec<8> (&sum)[9], float* pull) {
  const FrontCell& cell = p.cell;
  const bool is_viscous = cell.viscosity[0] > 0;
  Vec<8> G[9] = {};
  MeanGradient mean, rate;
  for (int k = 0; k < 27; ++k) {
    float value[3];
    p.node<false>(cell.node[k], value);
    for (float& x : value) x = cell.inverse_size * x;
    front::add_gradient(p, value, k, G);
    if (!is_viscous) continue;
    mean.add(value, k);
    p.node<true>(cell.node[k], value);
    for (float& x : value) x = cell.inverse_size * x;
    rate.add(value, k);
  }
  FrontStresses<LawOf> stresses(p);
  int before[27];
  for (int j = -1; j < cell.count; ++j) {  // with none of its nodes parted, with the first, ...
    if (j >= 0) {
      before[j] = stresses.count();  // those of what node j is not parted in
      const FrontPart& part = p.part(j);
      const float by = cell.inverse_size * part.side;
      float value[3];
      p.parted<false>(part.node, value);
      for (float& x : value) x = by * x;
      front::add_gradient(p, value, part.k, G);
      if (is_viscous) {
        mean.add(value, part.k);
        p.parted<true>(part.node, value);
        for (float& x : value) x = by * x;
        rate.add(value, part.k);
      }
      if (!(part.step > 0)) continue;
    }
    float viscous[9] = {};
    if (is_viscous) {
      float F[9], of_rate[9];
      mean.store(1, F);
      rate.store(0, of_rate);
      add_viscous_stress(F, of_rate, 0.125f * cell.viscosity[j < 0 ? 0 : 1], viscous);
    }
    const FrontPart& part = p.part(std::max(j, 0));
    stresses.add(G, j < 0 ? front::whole_weights(part) : front::weights(part), viscous);
  }
  stresses.work_out_rest();
  std::copy_n(stresses.sum(stresses.count()), 9, sum);
  for (int j = 0; j < cell.count; ++j) {
    const FrontPart& part = p.part(j);
    Vec<8> of_points[3] = {};
    for (int i = 0; i < 9; ++i) {
      of_points[i / 3] += (sum[i] - stresses.sum(before[j])[i]) * p.slope(part.k, i % 3);
    }
    store<4>(pull + 4 * j, -cell.inverse_size * part.side * sums(of_points));
  }
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
  Vec<8> sum[9];
  front_stresses<LawOf>(FrontPoints{cell, f}, sum, pull);
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
  const double sum = front::energy<LawOf>(FrontPoints{cell, f});
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
