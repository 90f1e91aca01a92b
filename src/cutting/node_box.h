// The 6 x 6 x 6 points around a node: those within its weight's support.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "mpm/lattice_body.h"

namespace tissue_sim {

/// Places in the box, x fastest: 36 bits of each z-plane.
using Planes = std::array<std::uint64_t, 6>;

/// The points around the node of cell (x, y, z), row by row along x.
class NodeBox {
 public:
  NodeBox(const LatticeBody& b, int x, int y, int z) {
    const bool inside =
        x >= 1 && y >= 1 && z >= 1 && x + 2 <= b.nx && y + 2 <= b.ny && z + 2 <= b.nz;
    if (!inside) points_around(b, x, y, z, copy_);
    for (int k = 0; k < 6; ++k) {
      const std::int32_t* plane =
          inside ? &b.point_at[((2 * z - 2 + k) * 2 * std::size_t(b.ny) + 2 * y - 2) * 2 * b.nx +
                               2 * x - 2]
                 : copy_ + 36 * k;
      for (int j = 0; j < 6; ++j) row_[6 * k + j] = plane + j * (inside ? 2 * b.nx : 6);
    }
  }
  const std::int32_t* row(int i) const { return row_[i]; }
  /// Whether a row has all its points; then they follow one another.
  bool is_whole(int i) const { return row_[i][0] >= 0 && row_[i][5] == row_[i][0] + 5; }

 private:
  const std::int32_t* row_[36];
  std::int32_t copy_[216];
};

/// Components of the bonds within the box, in the order of their first places; returns how many.
int find_components(const NodeBox& box, const Points& points, Planes (&found)[216]);

}  // namespace tissue_sim
