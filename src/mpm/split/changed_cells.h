// The cells around which something changes where points lose bonds.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// The cells of a body that lie near some of its points.
class CellsAround {
 public:
  /// Those within `reach` cells along each axis of cells that hold points of `some`.
  CellsAround(const LatticeBody& body, int reach, const Points& points,
              const std::vector<std::int32_t>& some);

  /// Calls f(x, y, z, node, near, count) for rows of the body's lattice nodes, in their order:
  /// `count` from x on, numbered from `node` on, of which near[i] says whether their cell is one.
  template <class F>
  void for_each_row(const F& f) const {
    for (int z = 0; z < n_[2]; ++z) {
      for (int y = 0; y < n_[1]; ++y) {
        const std::uint8_t* row = &near_[(static_cast<std::size_t>(z) * n_[1] + y) * n_[0]];
        body_.for_each_node_in_row(low_[0], low_[0] + n_[0], low_[1] + y, low_[2] + z,
                                   [&](int x, int node, int count) {
                                     f(x, low_[1] + y, low_[2] + z, node, row + x - low_[0], count);
                                   });
      }
    }
  }

 private:
  const LatticeBody& body_;
  int low_[3] = {}, n_[3] = {};     // of a box [cells]
  std::vector<std::uint8_t> near_;  // [z][y][x] of it
};

}  // namespace tissue_sim
