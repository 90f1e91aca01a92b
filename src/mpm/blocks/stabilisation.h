// Stabilisation of cells that hold few points.
//
// At the rim of a body and along a cut a cell may hold fewer than seven points, and nodes that one
// or two points see can then move without any strain at them: a point would hang loose from its
// neighbours. Of the 27 numbers (A, d, B along each axis) that a component of the displacement has
// in a cell, four belong to motions that vary linearly, and strain there is what the points resist.
// The other 23 get a small stiffness, kStabilisation mu V with the volume V of the cell's points,
// each weighed to count like a strain (A 1, d 1/2, B 1/4 along each axis). Linear fields, rotation
// and translation among them, stay free; smooth ones feel it at second order in the cell size.
#pragma once

#include "mpm/blocks/block_passes.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {

namespace stabilisation {

/// Kinds (0 A, 1 d, 2 B) along x and y of an XyQuantity.
inline constexpr int kKinds[kXyCount][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1},
                                            {1, 2}, {2, 0}, {2, 1}, {2, 2}};

/// Squared weight of the number with these kinds along x, y and z (A 1, d 1/4, B 1/16 along each
/// axis); 0 for those of linear fields.
TISSUE_SIM_INLINE constexpr float weight2(int x, int y, int z) {
  return x + y + z <= 1 ? 0.0f : 1.0f / static_cast<float>(1 << 2 * (x + y + z));
}
/// The same with an XyQuantity.
inline constexpr float weight2(int k, int z) { return weight2(kKinds[k][0], kKinds[k][1], z); }

}  // namespace stabilisation

/// Three values along one axis as A, d, B, in place; and back, as the transpose has it.
template <class T>
TISSUE_SIM_INLINE void to_line(T& minus, T& center, T& plus) {
  const Line<T> l(minus, center, plus);
  minus = l.A;
  center = l.d;
  plus = l.B;
}
template <class T>
TISSUE_SIM_INLINE void from_line(T& A, T& d, T& B) {
  const T sides = kAverageSide * A + B, center = kAverageCenter * A - 2.0f * B;
  B = sides + d;
  A = sides - d;
  d = center;
}

}  // namespace tissue_sim
