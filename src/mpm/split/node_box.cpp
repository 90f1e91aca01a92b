#include "mpm/split/node_box.h"

#include <utility>

#include "mpm/lattice/bonds.h"

namespace tissue_sim {

/// The places of a plane that bonds within it reach from those of m: all of them unless the bonds
/// wind.
inline std::uint64_t BondWindows::BoxBonds::spread(std::uint64_t m, int plane) const {
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
inline bool BondWindows::BoxBonds::take(std::uint64_t more, std::uint64_t& m, int plane) const {
  if ((more & ~m) == 0) return false;
  m |= more;
  while ((((m ^ m >> 1) & x[plane]) | ((m ^ m >> 8) & y[plane])) != 0) m = spread(m, plane);
  return true;
}

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
  for_each_site(points, changed, [&](std::int32_t p, const Points::Site& s) {
    OfBody& of = bodies_[s.body];
    for (int axis = 0; axis < 3; ++axis) {
      if ((points.bonds[p] >> (kForwardBond + axis) & 1) != 0) continue;
      for_each_window(of, s, [&](std::size_t at, std::uint8_t bit) {
        of.window[1 + axis][at] &= static_cast<std::uint8_t>(~bit);
      });
    }
  });
}

int BondWindows::find_components(int body, int x, int y, int z, Planes (&found)[216]) const {
  const BoxBonds bonds = bonds_in_box(body, x, y, z);
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

Planes BondWindows::bridge_ends(int body, int x, int y, int z) const {
  const BoxBonds b = bonds_in_box(body, x, y, z);
  Planes in_x{}, in_y{}, in_z{};  // bonds that are in a square
  for (int k = 0; k < 6; ++k) {
    const std::uint64_t xy = b.x[k] & b.x[k] >> 8 & b.y[k] & b.y[k] >> 1;  // by its first place
    in_x[k] |= xy | xy << 8;
    in_y[k] |= xy | xy << 1;
    if (k == 5) break;
    const std::uint64_t xz = b.x[k] & b.x[k + 1] & b.z[k] & b.z[k] >> 1;
    const std::uint64_t yz = b.y[k] & b.y[k + 1] & b.z[k] & b.z[k] >> 8;
    in_x[k] |= xz;
    in_x[k + 1] |= xz;
    in_y[k] |= yz;
    in_y[k + 1] |= yz;
    in_z[k] = xz | xz << 1 | yz | yz << 8;
  }
  constexpr std::uint64_t kInner = 0x1e1e1e1e00;
  Planes ends{};
  for (int k = 1; k < 5; ++k) {
    const std::uint64_t along_x = b.x[k] & ~in_x[k], along_y = b.y[k] & ~in_y[k];
    const std::uint64_t along_z = b.z[k] & ~in_z[k], below = b.z[k - 1] & ~in_z[k - 1];
    ends[k] = (along_x | along_x << 1 | along_y | along_y << 8 | along_z | below) & kInner;
  }
  return ends;
}

}  // namespace tissue_sim
