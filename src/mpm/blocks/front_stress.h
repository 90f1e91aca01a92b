// What the points of a cell at the front of a cut push, as the CPU and the GPU work it out.
//
// With the shares s_1 >= s_2 >= ... of a cell's parted nodes, its energy is
//   (1 - s_1) E_0 + (s_1 - s_2) E_1 + (s_2 - s_3) E_2 + ...,
// E_j that of its points where the first j of them are parted and the others are not: it goes from
// E_0, which the block has, to that of the cut without a jump, whichever node comes first. What is
// lambda's of it goes by shares (1 + k) s / (1 + k s), k = lambda / (3 mu), which soon come to 1: a
// cell that is cut in part gives way to its pressure, where that of E_0 would hold it together.
//
// `Points` are the eight points of a cell and has
//   T                            a float for each of them, or for the one that a thread has
//   cell, part(j)                FrontCell, FrontPart
//   slope(k, axis)               of the weight of node k, times the cell size
//   mu(), lambda(), keep(x)      FrontCell's; x, or 0 for places that are no point of it
//   sum(x)                       over all of them
//   node<kRate>(n, x)            displacement [m] or velocity [m/s] of a node
//   parted<kRate>(n, x)          the same of how far a parted node's sides are apart
#pragma once

#include "material/laws.h"
#include "mpm/split/front_cell.h"

namespace tissue_sim {
namespace front {

/// How much of a cell's energy of shape, and of volume, one of its E_j is.
struct Weights {
  float shape, volume;
};
/// Of what the cell has more than the block: that of E_0 by its first part, and of the E_j of one.
TISSUE_SIM_INLINE Weights whole_weights(const FrontPart& first) {
  return {-first.share, -first.volume_share};
}
TISSUE_SIM_INLINE Weights weights(const FrontPart& part) { return {part.step, part.volume_step}; }

/// The Lame parameters of the points in an E_j, times volumes.
template <class Points>
TISSUE_SIM_INLINE void weigh(const Points& p, const Weights& weights, typename Points::T& mu,
                             typename Points::T& lambda) {
  mu = weights.shape * p.mu();
  lambda = weights.volume * p.lambda();
}

/// Adds to G[9] the gradient of a field that is `value` at node k and 0 at the others.
template <class Points>
TISSUE_SIM_INLINE void add_gradient(const Points& p, const float (&value)[3], int k,
                                    typename Points::T* G) {
  for (int axis = 0; axis < 3; ++axis) {
    const typename Points::T slope = p.slope(k, axis);
    for (int c = 0; c < 3; ++c) G[3 * c + axis] += value[c] * slope;
  }
}

/// Gradient of displacement or velocity at the points, with no node parted.
template <bool kRate, class Points>
TISSUE_SIM_INLINE void gradient(const Points& p, typename Points::T* G) {
  for (int i = 0; i < 9; ++i) G[i] = typename Points::T{};
  for (int k = 0; k < 27; ++k) {
    float value[3];
    p.template node<kRate>(p.cell.node[k], value);
    for (float& x : value) x = p.cell.inverse_size * x;
    add_gradient(p, value, k, G);
  }
}

/// Adds to it what a parted node has more.
template <bool kRate, class Points>
TISSUE_SIM_INLINE void add_part(const Points& p, const FrontPart& part, typename Points::T* G) {
  const float by = p.cell.inverse_size * part.side;
  float value[3];
  p.template parted<kRate>(part.node, value);
  for (float& x : value) x = by * x;
  add_gradient(p, value, part.k, G);
}

/// F at the points of the cell, 1 where it has none: what is far from them may be no number there.
template <class Points>
TISSUE_SIM_INLINE void deformation(const Points& p, const typename Points::T* G,
                                   typename Points::T* F) {
  for (int i = 0; i < 9; ++i) F[i] = p.keep(G[i]) + (i % 4 == 0 ? 1.0f : 0.0f);
}

/// Stress of the points times their volumes, with the viscous one of the mean gradient, as far as
/// it is the cell's.
template <class LawOf, class Points>
TISSUE_SIM_INLINE void stress(const Points& p, const typename Points::T* G,
                              const typename Points::T* rate, float viscosity,
                              const Weights& weights, typename Points::T* P) {
  typename Points::T mu, lambda, F[1][9], of_points[1][9];
  weigh(p, weights, mu, lambda);
  deformation(p, G, F[0]);
  LawOf::template stresses<1>(F, &mu, &lambda, of_points);
  for (int i = 0; i < 9; ++i) P[i] = of_points[0][i];
  if (!(viscosity > 0)) return;
  float mean[9], mean_rate[9], viscous[9] = {};
  for (int i = 0; i < 9; ++i) {
    mean[i] = 0.125f * p.sum(G[i]) + (i % 4 == 0 ? 1.0f : 0.0f);
    mean_rate[i] = 0.125f * p.sum(rate[i]);
  }
  add_viscous_stress(mean, mean_rate, 0.125f * viscosity, viscous);
  for (int i = 0; i < 9; ++i) P[i] += weights.shape * viscous[i];
}

/// The energy that a cell has more than the block's, without what stabilises it [J].
template <class LawOf, class Points>
TISSUE_SIM_INLINE double energy(const Points& p) {
  using T = typename Points::T;
  T mu, lambda, G[9], F[1][9], of_points;
  gradient<false>(p, G);
  deformation(p, G, F[0]);
  weigh(p, whole_weights(p.part(0)), mu, lambda);
  LawOf::template energies<1>(F, &mu, &lambda, &of_points);
  double sum = p.sum(of_points);
  for (int j = 0; j < p.cell.count; ++j) {
    const FrontPart& part = p.part(j);
    add_part<false>(p, part, G);
    if (!(part.step > 0)) continue;
    deformation(p, G, F[0]);
    weigh(p, weights(part), mu, lambda);
    LawOf::template energies<1>(F, &mu, &lambda, &of_points);
    sum += p.sum(of_points);
  }
  return sum;
}

}  // namespace front
}  // namespace tissue_sim
