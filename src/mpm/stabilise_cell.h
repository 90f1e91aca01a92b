// Stabilisation of one cell (stabilisation.h) on the CPU: apart, for nvcc takes no
// vectors.
#pragma once

#include "mpm/stabilisation.h"

namespace tissue_sim {

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
inline float stabilise(float stiffness, const float* u, int pitch, int plane, float* force) {
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
