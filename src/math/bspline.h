// Quadratic B-spline weights of the lattice. A point sits a quarter of a cell below (s = 0) or
// above (s = 1) its node along each axis, so the weights of the three nodes are constants.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {

/// Weight of the node at offset d - 1 (d = 0, 1, 2) for the point at s: 1/2 (3/2 - |r|)^2 or 3/4 -
/// r^2.
TISSUE_SIM_INLINE constexpr float lattice_weight(int s, int d) {
  return d == 1 ? 0.6875f : ((d == 2) == (s == 1) ? 0.28125f : 0.03125f);
}

/// Its derivative by the point's position, times the cell size.
TISSUE_SIM_INLINE float lattice_slope(int s, int d) {
  if (d == 1) return s == 1 ? -0.5f : 0.5f;
  return (d == 2 ? 1.0f : -1.0f) * ((d == 2) == (s == 1) ? 0.75f : 0.25f);
}

/// Weight of the node at offset d - 1 (d = 0, 1, 2) for a place in cells from the middle of the
/// cell: the cell's own quadratics, in and outside of it.
TISSUE_SIM_INLINE float cell_weight(float place, int d) {
  if (d == 1) return 0.75f - place * place;
  const float side = d == 0 ? 0.5f - place : 0.5f + place;
  return 0.5f * side * side;
}

// On the three node values u-, u0, u+ of a line, both points' values and slopes follow from
//   average    A = 11/16 u0 + 5/32 (u+ + u-)
//   difference d = u+ - u-
//   bend       B = u+ + u- - 2 u0
// as value(s) = A +- d / 8 and slope(s) = d / 2 +- B / 4 (+ for s = 1), which is what the kernels
// of src/mpm/ apply direction by direction.
inline constexpr float kAverageCenter = 0.6875f, kAverageSide = 0.15625f;

}  // namespace tissue_sim
