// What holds together around a cell.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "mpm/lattice/bonds.h"
#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// A site of the lattice; for Surroundings from the lowest of the cell's.
using Place = std::array<int, 3>;

/// How tissue ends: bonds are broken, or there is no more of it.
enum class End { kNone, kCut, kOuter };

/// The bonds of the points around a cell, as far out as the end of tissue is looked for.
class Surroundings {
 public:
  Surroundings(const LatticeBody& body, const Points& points, const Place& corner) {
    const int x0 = corner[0] + kFrom;
    std::fill(std::begin(bonds_), std::end(bonds_), kNoPoint);
    for (int k = 0, i = 0; k < kWidth; ++k) {
      for (int j = 0; j < kWidth; ++j, i += kWidth) {
        body.for_each_point_in_row(x0, x0 + kWidth, corner[1] + kFrom + j, corner[2] + kFrom + k,
                                   [&](int x, int point, int count) {
                                     std::copy_n(&points.bonds[point], count, bonds_ + i + x - x0);
                                   });
      }
    }
  }

  /// How many sites above or below `lower` tissue ends next in that way, within two; 9 where it
  /// does not, or in both directions.
  int nearest_end(const Place& lower, int axis, End end) const {
    const int at = index(lower);
    if (end_at(at, axis) == end) return 0;
    for (int m = 1; m <= 2; ++m) {
      const bool above = end_at(at + m * kStep[axis], axis) == end,
                 below = end_at(at - m * kStep[axis], axis) == end;
      if (above || below) return above && below ? 9 : above ? m : -m;
    }
    return 9;
  }

 private:
  static constexpr int kFrom = -3, kWidth = 8;  // sites
  static constexpr int kStep[3] = {1, kWidth, kWidth* kWidth};
  static constexpr std::uint8_t kNoPoint = 0xff;

  static int index(const Place& p) {
    return ((p[2] - kFrom) * kWidth + p[1] - kFrom) * kWidth + p[0] - kFrom;
  }
  /// How tissue ends between a site and the next along `axis`: their bond is broken, or one is
  /// empty.
  End end_at(int lower, int axis) const {
    const std::uint8_t p = bonds_[lower], q = bonds_[lower + kStep[axis]];
    if (p == kNoPoint || q == kNoPoint) return p == q ? End::kNone : End::kOuter;
    return (p >> (kForwardBond + axis) & 1) == 0 ? End::kCut : End::kNone;
  }

  std::uint8_t bonds_[kWidth * kWidth * kWidth];
};

}  // namespace tissue_sim
