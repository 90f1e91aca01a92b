// Stabilisation of cells that are not full.
//
// At the rim of a body and along a cut a cell may hold fewer than eight points, and nodes that one
// or two points see can then move without any strain at them: a point would hang loose from its
// neighbours. Of the 27 numbers (A, d, B along each axis) that a component of the displacement has
// in a cell, four belong to motions that vary linearly, and strain there is what the points resist.
// The other 23 get a small stiffness, kStabilisation mu V with the volume V of the cell's points,
// each weighed to count like a strain (A 1, d 1/2, B 1/4 along each axis). Linear fields, rotation
// and translation among them, stay free; smooth ones feel it at second order in the cell size.
#pragma once

#include "mpm/block_passes.h"

namespace tissue_sim {

inline constexpr float kStabilisation = 0.01f;
/// A cell with this many points needs none: seven leave no motion loose, while pieces of cells with
/// five or six may have motions thirty times as soft as with stabilisation.
inline constexpr int kSteadyCount = 7;

namespace stabilisation {

/// Squared weight of A, d, B along one axis.
inline constexpr float kWeight2[3] = {1.0f, 0.25f, 0.0625f};
/// Kinds (0 A, 1 d, 2 B) along x and y of an XyQuantity.
inline constexpr int kKinds[kXyCount][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1},
                                            {1, 2}, {2, 0}, {2, 1}, {2, 2}};

/// Squared weight of the number with these kinds along x, y and z; 0 for those of linear fields.
inline constexpr float weight2(int x, int y, int z) {
  return x + y + z <= 1 ? 0.0f : kWeight2[x] * kWeight2[y] * kWeight2[z];
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

/// What the kinds y and z leave of the stiffness along x: the symmetric matrices sum_k weight2(k,
/// y, z) b_k b_k^T, with the three b_k that make A, d and B of a row's nodes. By columns; a row of
/// zeros follows.
struct StiffnessAlongX {
  alignas(16) float column[9][3][4];  ///< [y + 3 z]
  constexpr StiffnessAlongX() : column() {
    constexpr float b[3][3] = {
        {kAverageSide, kAverageCenter, kAverageSide}, {-1, 0, 1}, {1, -2, 1}};
    for (int i = 0; i < 81; ++i) {
      const int row = i % 3, of = i / 3 % 3, kinds = i / 9;
      for (int k = 0; k < 3; ++k) {
        column[kinds][of][row] +=
            stabilisation::weight2(k, kinds % 3, kinds / 3) * b[k][of] * b[k][row];
      }
    }
  }
};

/// Adds the force that stabilises one component of a cell, times -cell size, to its 27 nodes in
/// `force` where there is one; `u` are displacements over cell size, `stiffness` kStabilisation mu
/// V. Both from the lowest node; rows are read and written four nodes wide, the fourth unchanged.
/// Returns twice the energy.
TISSUE_SIM_INLINE float stabilise(float stiffness, const float* u, int pitch, int plane,
                                  float* force) {
  static constexpr StiffnessAlongX along_x;
  Vec<4> v[9], twice_energy = {};
  for (int i = 0; i < 9; ++i) v[i] = load<4>(u + i / 3 * plane + i % 3 * pitch);
  for (int z = 0; z < 9; z += 3) to_line(v[z], v[z + 1], v[z + 2]);
  for (int y = 0; y < 3; ++y) to_line(v[y], v[y + 3], v[y + 6]);
  for (int i = 0; i < 9; ++i) {
    const auto& column = along_x.column[i];
    const Vec<4> f = stiffness * (v[i][0] * load<4>(column[0]) + v[i][1] * load<4>(column[1]) +
                                  v[i][2] * load<4>(column[2]));
    twice_energy += f * v[i];
    v[i] = f;
  }
  if (force != nullptr) {
    for (int y = 0; y < 3; ++y) from_line(v[y], v[y + 3], v[y + 6]);
    for (int z = 0; z < 9; z += 3) from_line(v[z], v[z + 1], v[z + 2]);
    for (int i = 0; i < 9; ++i) {
      float* to = force + i / 3 * plane + i % 3 * pitch;
      store<4>(to, load<4>(to) + v[i]);
    }
  }
  return twice_energy[0] + twice_energy[1] + twice_energy[2];
}

}  // namespace tissue_sim
