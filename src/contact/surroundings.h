// What holds together around a cell.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "cutting/bonds.h"
#include "mpm/lattice_body.h"

namespace tissue_sim {

/// A site of the lattice; for Surroundings from the lowest of the cell's.
using Place = std::array<int, 3>;

/// How tissue ends: bonds are broken, or there is no more of it.
enum class End { kNone, kCut, kOuter };

/// The bonds of the points around a cell, as far out as the end of tissue is looked for.
class Surroundings {
 public:
  Surroundings(const LatticeBody& body, const Points& points, const Place& corner) {
    const int x = corner[0] + kFrom, sx = 2 * body.nx;
    const int first = std::max(0, -x), last = std::min(kWidth, sx - x) - 1;  // within the body
    std::fill(std::begin(bonds_), std::end(bonds_), kNoPoint);
    for (int k = 0, i = 0; k < kWidth; ++k) {
      for (int j = 0; j < kWidth; ++j, i += kWidth) {
        const int y = corner[1] + kFrom + j, z = corner[2] + kFrom + k;
        if (y < 0 || z < 0 || y >= 2 * body.ny || z >= 2 * body.nz) continue;
        const std::int32_t* row =
            &body.point_at[(static_cast<std::size_t>(z) * 2 * body.ny + y) * sx + x + first];
        const int count = last - first + 1;
        if (row[0] >= 0 && row[count - 1] == row[0] + count - 1) {  // points follow one another
          std::copy_n(&points.bonds[row[0]], count, bonds_ + i + first);
          continue;
        }
        for (int n = 0; n < count; ++n) {
          if (row[n] >= 0) bonds_[i + first + n] = points.bonds[row[n]];
        }
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
