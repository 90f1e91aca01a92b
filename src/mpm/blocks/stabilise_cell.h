// Stabilisation of one cell (stabilisation.h) on the CPU: apart, for nvcc takes no
// vectors.
#pragma once

#include <cstddef>
#include <cstring>

#include "mpm/blocks/stabilisation.h"

namespace tissue_sim {

/// What the kinds y and z leave of the stiffness along x: the symmetric matrices sum_k weight2(k,
/// y, z) b_k b_k^T, with the three b_k that make A, d and B of a row's nodes. By columns; a row of
/// zeros follows, and all that again for each component.
struct StiffnessAlongX {
  alignas(64) float column[9][3][16];  ///< [y + 3 z]
  constexpr StiffnessAlongX() : column() {
    constexpr float b[3][3] = {
        {kAverageSide, kAverageCenter, kAverageSide}, {-1, 0, 1}, {1, -2, 1}};
    for (int i = 0; i < 81; ++i) {
      const int row = i % 3, of = i / 3 % 3, kinds = i / 9;
      for (int k = 0; k < 3; ++k) {
        const float add = stabilisation::weight2(k, kinds % 3, kinds / 3) * b[k][of] * b[k][row];
        for (int c = 0; c < 4; ++c) column[kinds][of][4 * c + row] += add;
      }
    }
  }
};

/// Four nodes of a row: of one component, or, where W is 16, of the three that lie `component`
/// floats apart, one after the other and then zeros.
template <int W>
TISSUE_SIM_INLINE Vec<W> load_row(const float* u, std::ptrdiff_t component) {
  if constexpr (W == 4) {
    return load<4>(u);
  } else {
    constexpr Mask<16> kX = {-1, -1, -1, -1}, kY = {0, 0, 0, 0, -1, -1, -1, -1},
                       kZ = {0, 0, 0, 0, 0, 0, 0, 0, -1, -1, -1, -1};
    return reinterpret_cast<Vec<16>>((bits<16>(load<16>(u)) & kX) |
                                     (bits<16>(load<16>(u + component - 4)) & kY) |
                                     (bits<16>(load<16>(u + 2 * component - 8)) & kZ));
  }
}
/// Adds them to four nodes.
template <int W>
TISSUE_SIM_INLINE void add_row(Vec<W> v, float* to, std::ptrdiff_t component) {
  for (int c = 0; c < (W == 4 ? 1 : 3); ++c) {
    Vec<4> of;
    std::memcpy(&of, reinterpret_cast<const char*>(&v) + c * sizeof(of), sizeof(of));
    store<4>(to + c * component, load<4>(to + c * component) + of);
  }
}
/// Of each four lanes the i-th, four times.
template <int W>
TISSUE_SIM_INLINE Vec<W> of_node(Vec<W> v, int i) {
  Mask<W> from;
  for (int j = 0; j < W; ++j) from[j] = j / 4 * 4 + i;
  return permute<W>(v, from);
}

/// Adds the force that stabilises one component of a cell, or with W = 16 all three of them, times
/// -cell size, to its 27 nodes in `force` where there is one; `u` are displacements over cell size,
/// `stiffness` kStabilisation mu V. Both from the lowest node, with so many floats from component
/// to component; rows are read and written four nodes wide, the fourth unchanged. Returns twice the
/// energy.
template <int W>
TISSUE_SIM_INLINE float stabilise(float stiffness, const float* u, std::ptrdiff_t u_component,
                                  int pitch, int plane, float* force,
                                  std::ptrdiff_t force_component) {
  static constexpr StiffnessAlongX along_x;
  Vec<W> v[9], twice_energy = {};
  for (int i = 0; i < 9; ++i) v[i] = load_row<W>(u + i / 3 * plane + i % 3 * pitch, u_component);
  for (int z = 0; z < 9; z += 3) to_line(v[z], v[z + 1], v[z + 2]);
  for (int y = 0; y < 3; ++y) to_line(v[y], v[y + 3], v[y + 6]);
  for (int i = 0; i < 9; ++i) {
    const auto& column = along_x.column[i];
    const Vec<W> f = stiffness * (of_node<W>(v[i], 0) * load<W>(column[0]) +
                                  of_node<W>(v[i], 1) * load<W>(column[1]) +
                                  of_node<W>(v[i], 2) * load<W>(column[2]));
    twice_energy += f * v[i];
    v[i] = f;
  }
  if (force != nullptr) {
    for (int y = 0; y < 3; ++y) from_line(v[y], v[y + 3], v[y + 6]);
    for (int z = 0; z < 9; z += 3) from_line(v[z], v[z + 1], v[z + 2]);
    for (int i = 0; i < 9; ++i) {
      add_row<W>(v[i], force + i / 3 * plane + i % 3 * pitch, force_component);
    }
  }
  float sum = 0;
  for (int i = 0; i < W; ++i) sum += i % 4 < 3 ? twice_energy[i] : 0;
  return sum;
}

}  // namespace tissue_sim
