// The 6 x 6 x 6 points around a node: those within its weight's support.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// Places in the box: for each z-plane a byte of each of its six rows, x fastest.
using Planes = std::array<std::uint64_t, 6>;
/// Bit of a place in its plane.
constexpr int bit_in_plane(int x, int y) { return 8 * y + x; }

/// The bonds of all bodies, so that those of a node's box are at hand: for each two columns of
/// nodes along z and each row of points a byte with its places in the boxes of these nodes.
class BondWindows {
  struct OfBody {
    int rows_y, rows_z;                   ///< of points, with those of boxes that reach outside
    std::vector<std::uint8_t> window[4];  ///< [(nx + 1) / 2 + 1][rows_z][rows_y]: points; their
                                          ///< bonds forward along x, y and z
    /// Window `column` of the row at y, z (half cells): it holds places 4 column - kOutside to
    /// 4 column + 3.
    std::size_t at(int column, int y, int z) const {
      return (static_cast<std::size_t>(column) * rows_z + z + kOutside) * rows_y + y + kOutside;
    }
  };
  static constexpr int kOutside = 4;  // how far boxes reach outside of the body

 public:
  BondWindows(const std::vector<LatticeBody>& bodies, const Points& points);
  /// After the points `changed` lost bonds.
  void update(const Points& points, const std::vector<std::int32_t>& changed);

  /// The places of the box of the node of cell (x, y, z) where there are points.
  Planes points_in_box(int body, int x, int y, int z) const {
    return read(bodies_[body], 0, x, y, z, 0x3f3f3f3f3f3f);
  }
  /// Components of the bonds within the box of the node of cell (x, y, z), in the order of their
  /// first places; returns how many.
  int find_components(int body, int x, int y, int z, Planes (&found)[216]) const;
  /// Of the 4 x 4 x 4 places around the node of cell (x, y, z), those with a bond that is in no
  /// square of four bonds.
  Planes bridge_ends(int body, int x, int y, int z) const;

 private:
  /// The bonds within a box.
  struct BoxBonds {
    Planes there, x, y, z;  ///< points; their bonds to the next place
    std::uint64_t spread(std::uint64_t m, int plane) const;
    bool take(std::uint64_t more, std::uint64_t& m, int plane) const;
  };
  BoxBonds bonds_in_box(int body, int x, int y, int z) const {
    const OfBody& of = bodies_[body];
    return {read(of, 0, x, y, z, 0x3f3f3f3f3f3f), read(of, 1, x, y, z, 0x1f1f1f1f1f1f),
            read(of, 2, x, y, z, 0x003f3f3f3f3f), read(of, 3, x, y, z, 0x3f3f3f3f3f3f)};
  }

  /// One of the windows' kinds in a box, but for places not `within`.
  static Planes read(const OfBody& of, int kind, int x, int y, int z, std::uint64_t within) {
    Planes planes;
    const int column = (x + 1) / 2, first = (x + 1) % 2 * 2;
    for (int k = 0; k < 6; ++k) {
      std::memcpy(&planes[k], &of.window[kind][of.at(column, 2 * y - 2, 2 * z - 2 + k)], 8);
      planes[k] = planes[k] >> first & within;
    }
    return planes;
  }
  /// Calls f(index, bit) for each window that holds a point.
  template <class F>
  static void for_each_window(const OfBody& of, const Points::Site& s, const F& f) {
    const int place = s.x + kOutside;
    for (int column = place / 4 - 1; column <= place / 4; ++column) {
      f(of.at(column, s.y, s.z), static_cast<std::uint8_t>(1u << (place - 4 * column)));
    }
  }

  std::vector<OfBody> bodies_;
};

}  // namespace tissue_sim
