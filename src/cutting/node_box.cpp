#include "cutting/node_box.h"

#include <utility>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// The bonds within a box.
struct BoxBonds {
  Planes there, x, y, z;  ///< points; their bonds to the next place

  /// The places of a plane that bonds within it reach from those of m: all of them unless the bonds
  /// wind.
  std::uint64_t spread(std::uint64_t m, int plane) const {
    std::uint64_t along = x[plane], across = y[plane];  // bonds of 1, then 2 and 4 places in a row
    for (int step = 1; step <= 4; step *= 2) {
      m |= (m & along) << step | (m >> step & along);
      along &= along >> step;
    }
    for (int step = 8; step <= 32; step *= 2) {
      m |= (m & across) << step | (m >> step & across);
      across &= across >> step;
    }
    return m;
  }

  /// Takes up more of a plane's places into m, and what bonds within the plane reach from them.
  /// Returns whether there were any.
  bool take(std::uint64_t more, std::uint64_t& m, int plane) const {
    if ((more & ~m) == 0) return false;
    m |= more;
    while ((((m ^ m >> 1) & x[plane]) | ((m ^ m >> 8) & y[plane])) != 0) m = spread(m, plane);
    return true;
  }
};

}  // namespace

BondWindows::BondWindows(const std::vector<LatticeBody>& bodies, const Points& points) {
  for (const LatticeBody& b : bodies) {
    OfBody of{2 * (b.ny + kOutside), 2 * (b.nz + kOutside), {}};
    const std::size_t size = of.at((b.nx + 1) / 2 + 1, -kOutside, -kOutside);
    for (std::vector<std::uint8_t>& window : of.window) window.assign(size + 2, 0);
    bodies_.push_back(std::move(of));
  }
  for (std::int32_t p = 0; p < points.size(); ++p) {
    const Points::Site& s = points.site[p];
    OfBody& of = bodies_[s.body];
    for_each_window(of, s, [&](std::size_t at, std::uint8_t bit) {
      of.window[0][at] |= bit;
      for (int axis = 0; axis < 3; ++axis) {
        if ((points.bonds[p] >> (kForwardBond + axis) & 1) != 0) of.window[1 + axis][at] |= bit;
      }
    });
  }
}

void BondWindows::update(const Points& points, const std::vector<std::int32_t>& changed) {
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    OfBody& of = bodies_[s.body];
    for (int axis = 0; axis < 3; ++axis) {
      if ((points.bonds[p] >> (kForwardBond + axis) & 1) != 0) continue;
      for_each_window(of, s, [&](std::size_t at, std::uint8_t bit) {
        of.window[1 + axis][at] &= static_cast<std::uint8_t>(~bit);
      });
    }
  }
}

int BondWindows::find_components(int body, int x, int y, int z, Planes (&found)[216]) const {
  const OfBody& of = bodies_[body];
  const BoxBonds bonds{read(of, 0, x, y, z, 0x3f3f3f3f3f3f), read(of, 1, x, y, z, 0x1f1f1f1f1f1f),
                       read(of, 2, x, y, z, 0x003f3f3f3f3f), read(of, 3, x, y, z, 0x3f3f3f3f3f3f)};
  Planes left = bonds.there;
  int count = 0;
  for (int start = 0; start < 6; ++start) {
    while (left[start] != 0) {
      Planes& reached = found[count++];
      reached = {};
      // Upwards, then downwards, until nothing more is reached.
      bonds.take(left[start] & -left[start], reached[start], start);
      for (bool more = true; more;) {
        for (int z = 1; z < 6; ++z) bonds.take(reached[z - 1] & bonds.z[z - 1], reached[z], z);
        more = false;
        for (int z = 4; z >= 0; --z) more |= bonds.take(reached[z + 1] & bonds.z[z], reached[z], z);
      }
      for (int z = 0; z < 6; ++z) left[z] &= ~reached[z];
    }
  }
  return count;
}

}  // namespace tissue_sim
