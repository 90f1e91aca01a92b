// What the points of a cell at the front of a cut push, as the CPU and the GPU work it out.
//
// With the shares s_1 >= s_2 >= ... of a cell's parted nodes, its energy is
//   (1 - s_1) E_0 + (s_1 - s_2) E_1 + (s_2 - s_3) E_2 + ...,
// E_j that of its points where the first j of them are parted and the others are not: it goes from
// E_0, which the block has, to that of the cut without a jump, whichever node comes first.
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

/// Stress of the points times their volumes, with the viscous one of the mean gradient.
template <class LawOf, class Points>
TISSUE_SIM_INLINE void stress(const Points& p, const typename Points::T* G,
                              const typename Points::T* rate, float viscosity,
                              typename Points::T* P) {
  const typename Points::T mu = p.mu(), lambda = p.lambda();
  typename Points::T F[1][9], of_points[1][9];
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
  for (int i = 0; i < 9; ++i) P[i] += viscous[i];
}

/// The energy that a cell has more than the block's, without what stabilises it [J].
template <class LawOf, class Points>
TISSUE_SIM_INLINE double energy(const Points& p) {
  using T = typename Points::T;
  const T mu = p.mu(), lambda = p.lambda();
  T G[9], F[1][9], of_points;
  gradient<false>(p, G);
  deformation(p, G, F[0]);
  LawOf::template energies<1>(F, &mu, &lambda, &of_points);
  double sum = -static_cast<double>(p.part(0).share) * p.sum(of_points);
  for (int j = 0; j < p.cell.count; ++j) {
    const FrontPart& part = p.part(j);
    add_part<false>(p, part, G);
    if (!(part.step > 0)) continue;
    deformation(p, G, F[0]);
    LawOf::template energies<1>(F, &mu, &lambda, &of_points);
    sum += static_cast<double>(part.step) * p.sum(of_points);
  }
  return sum;
}

}  // namespace front
}  // namespace tissue_sim
