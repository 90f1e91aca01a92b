// What holds together around a cell.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

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
    for (int k = 0, i = 0; k < kWidth; ++k) {
      for (int j = 0; j < kWidth; ++j, i += kWidth) {
        const int y = corner[1] + kFrom + j, z = corner[2] + kFrom + k;
        const bool inside = y >= 0 && z >= 0 && y < 2 * body.ny && z < 2 * body.nz;
        const std::ptrdiff_t row = (static_cast<std::ptrdiff_t>(z) * 2 * body.ny + y) * sx + x;
        for (int n = 0; n < kWidth; ++n) {
          const std::int32_t p = inside && x + n >= 0 && x + n < sx ? body.point_at[row + n] : -1;
          bonds_[i + n] = p < 0 ? kNoPoint : points.bonds[p];
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
