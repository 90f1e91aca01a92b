// Points of a torn body for the detection of fragments: a lattice, two points a cell along each
// axis, cut into blocks that flew apart by a few cells, each by as much.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "paper/cell_box.h"

namespace tissue_sim {

struct TornPoints {
  int dimensions = 2;
  std::vector<float> x[3];                         ///< [cells]
  std::vector<std::array<std::int32_t, 2>> links;  ///< of neighbours in one block
  CellBox box;                                     ///< a little larger than what they fill
  PointPlaces places() const {
    PointPlaces p;
    for (int a = 0; a < dimensions; ++a) p.x[a] = x[a].data();
    p.count = static_cast<std::int32_t>(x[0].size());
    return p;
  }
};

/// `points` or a few more, in blocks of `block` points along each axis, `gap` cells apart; in a box
/// of `cells` cells along each axis, or as many as it takes.
inline TornPoints torn_points(int dimensions, int points, int block, int gap, int cells = 0) {
  TornPoints torn;
  torn.dimensions = dimensions;
  const int n = static_cast<int>(std::ceil(std::pow(points, 1.0 / dimensions) - 1e-9));
  const int nz = dimensions == 3 ? n : 1;
  const auto along = [&](int i) {
    return static_cast<float>(4.25 + 0.5 * i + static_cast<double>(i / block) * gap);
  };
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const auto p = static_cast<std::int32_t>(torn.x[0].size());
        const int at[3] = {x, y, z}, step[3] = {1, n, n * n};
        for (int a = 0; a < dimensions; ++a) {
          torn.x[a].push_back(along(at[a]));
          if (at[a] % block != 0) torn.links.push_back({p - step[a], p});
        }
      }
    }
  }
  const int needed = static_cast<int>(along(n - 1)) + 5;
  for (int a = 0; a < dimensions; ++a) torn.box.n[a] = cells > needed ? cells : needed;
  return torn;
}

}  // namespace tissue_sim
