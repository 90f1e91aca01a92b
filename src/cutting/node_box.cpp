#include "cutting/node_box.h"

#include <cstring>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// The lowest bits of a word's first six bytes.
std::uint64_t row_bits(std::uint64_t bytes) { return (bytes * 0x0102040810204080) >> 56 & 0x3f; }

/// The bonds within the box.
struct BoxBonds {
  Planes there = {}, x = {}, y = {}, z = {};  ///< points; their bonds to the next place

  BoxBonds(const NodeBox& box, const Points& points) {
    constexpr std::uint64_t kNotLastX = 0x7df7df7df, kNotLastY = 0x3fffffff, kAll = 0x010101010101;
    for (int plane = 0, row = 0; plane < 6; ++plane) {
      for (int shift = 0; shift < 36; shift += 6, ++row) {
        const std::int32_t* p = box.row(row);
        std::uint64_t bonds = 0, any = 0x3f;  // a byte of each point; a bit of each that there is
        if (box.is_whole(row)) {
          std::memcpy(&bonds, &points.bonds[p[0]], 6);
        } else {
          any = 0;
          for (int i = 0; i < 6; ++i) {
            if (p[i] < 0) continue;
            bonds |= std::uint64_t(points.bonds[p[i]]) << (8 * i);
            any |= std::uint64_t(1) << i;
          }
        }
        there[plane] |= any << shift;
        x[plane] |= row_bits(bonds >> kForwardBond & kAll) << shift;
        y[plane] |= row_bits(bonds >> (kForwardBond + 1) & kAll) << shift;
        z[plane] |= row_bits(bonds >> (kForwardBond + 2) & kAll) << shift;
      }
      x[plane] &= kNotLastX;
      y[plane] &= kNotLastY;
    }
  }

  /// The places of a plane that bonds within it reach from those of m: all of them unless the bonds
  /// wind.
  std::uint64_t spread(std::uint64_t m, int plane) const {
    std::uint64_t along = x[plane], across = y[plane];  // bonds of 1, then 2 and 4 places in a row
    for (int step = 1; step <= 4; step *= 2) {
      m |= (m & along) << step | (m >> step & along);
      along &= along >> step;
    }
    for (int step = 6; step <= 24; step *= 2) {
      m |= (m & across) << step | (m >> step & across);
      across &= across >> step;
    }
    return m;
  }

  /// Whether no bond leads out of the places.
  bool is_closed(const Planes& m) const {
    std::uint64_t out = 0;
    for (int i = 0; i < 6; ++i) {
      out |= ((m[i] ^ m[i] >> 1) & x[i]) | ((m[i] ^ m[i] >> 6) & y[i]);
      if (i < 5) out |= (m[i] ^ m[i + 1]) & z[i];
    }
    return out == 0;
  }
};

}  // namespace

int find_components(const NodeBox& box, const Points& points, Planes (&found)[216]) {
  const BoxBonds bonds(box, points);
  Planes left = bonds.there;
  int count = 0;
  for (int start = 0; start < 6; ++start) {
    while (left[start] != 0) {
      Planes& reached = found[count++];
      reached = {};
      reached[start] = left[start] & -left[start];
      do {
        reached[0] = bonds.spread(reached[0], 0);
        for (int z = 1; z < 6; ++z) {
          reached[z] = bonds.spread(reached[z] | (reached[z - 1] & bonds.z[z - 1]), z);
        }
        for (int z = 4; z >= 0; --z) {
          reached[z] = bonds.spread(reached[z] | (reached[z + 1] & bonds.z[z]), z);
        }
      } while (!bonds.is_closed(reached));
      for (int z = 0; z < 6; ++z) left[z] &= ~reached[z];
    }
  }
  return count;
}

}  // namespace tissue_sim
