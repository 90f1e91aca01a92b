// The transfers between the 27 nodes and the eight points of one cell, for where few cells need
// them: contact with tools and the ground. All vectors are (x, y, z, 0).
#pragma once

#include "compute/simd.h"
#include "math/bspline.h"
#include "mpm/surface/facet_motion.h"

namespace tissue_sim {

namespace cell_points {

/// Values at the two points of a line from those at its three nodes.
TISSUE_SIM_INLINE void to_points(Vec<4> minus, Vec<4> center, Vec<4> plus, Vec<4>& at0,
                                 Vec<4>& at1) {
  const Vec<4> average = kAverageSide * (minus + plus) + kAverageCenter * center;
  const Vec<4> slope = 0.125f * (plus - minus);
  at0 = average - slope;
  at1 = average + slope;
}

/// Its transpose.
TISSUE_SIM_INLINE void to_nodes(Vec<4> at0, Vec<4> at1, Vec<4>& minus, Vec<4>& center,
                                Vec<4>& plus) {
  const Vec<4> sum = at0 + at1, sides = kAverageSide * sum, slope = 0.125f * (at1 - at0);
  minus = sides - slope;
  center = kAverageCenter * sum;
  plus = sides + slope;
}

}  // namespace cell_points

/// A node field of three components at a cell's points, value[sx + 2 sy + 4 sz].
inline void values_at_points(const Array<float>* field, const CellNodes& nodes,
                             Vec<4> (&value)[8]) {
  const float *fx = field[0].data(), *fy = field[1].data(), *fz = field[2].data();
  Vec<4> y_lines[3][4];
  for (int z = 0; z < 3; ++z) {
    Vec<4> x_lines[3][2];
    for (int y = 0; y < 3; ++y) {
      const std::int32_t* n = nodes.lowest + z * nodes.plane + y * nodes.pitch;
      const auto at = [=](int i) { return Vec<4>{fx[n[i]], fy[n[i]], fz[n[i]], 0.0f}; };
      cell_points::to_points(at(0), at(1), at(2), x_lines[y][0], x_lines[y][1]);
    }
    for (int x = 0; x < 2; ++x) {
      cell_points::to_points(x_lines[0][x], x_lines[1][x], x_lines[2][x], y_lines[z][x],
                             y_lines[z][x + 2]);
    }
  }
  for (int xy = 0; xy < 4; ++xy) {
    cell_points::to_points(y_lines[0][xy], y_lines[1][xy], y_lines[2][xy], value[xy],
                           value[xy + 4]);
  }
}

/// Its transpose: adds forces at a cell's points to those on the block's nodes, [3][nz + 2][plane],
/// of which `node` is the cell's lowest.
inline void spread(const Block& block, int node, const Vec<4> (&push)[8], float* force) {
  Vec<4> y_lines[3][4];
  for (int xy = 0; xy < 4; ++xy) {
    cell_points::to_nodes(push[xy], push[xy + 4], y_lines[0][xy], y_lines[1][xy], y_lines[2][xy]);
  }
  const int component = block.node_count();
  for (int z = 0; z < 3; ++z) {
    Vec<4> x_lines[3][2];
    for (int x = 0; x < 2; ++x) {
      cell_points::to_nodes(y_lines[z][x], y_lines[z][x + 2], x_lines[0][x], x_lines[1][x],
                            x_lines[2][x]);
    }
    for (int y = 0; y < 3; ++y) {
      Vec<4> at[3];
      cell_points::to_nodes(x_lines[y][0], x_lines[y][1], at[0], at[1], at[2]);
      float* to = force + node + z * block.plane + y * block.pitch;
      for (int c = 0; c < 3; ++c) {
        for (int x = 0; x < 3; ++x) to[c * component + x] += at[x][c];
      }
    }
  }
}

}  // namespace tissue_sim
