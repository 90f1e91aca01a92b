// Bonds: which of its 6 lattice neighbours a point holds on to. Cuts and tears clear them, nothing
// sets them again; everything about connection follows from them.
//
// Six, not 26: a surface that parts two points also parts every path over faces between them, and a
// point that hung on to its piece by a diagonal alone would be a hinge, free to move without
// strain.
#pragma once

#include <cstdint>

#include "compute/host_device.h"

namespace tissue_sim {

inline constexpr int kBondCount = 6;
inline constexpr std::uint8_t kAllBonds = (1u << kBondCount) - 1;

/// Offset to the neighbour of bond `k`: -z, -y, -x, +x, +y, +z. Bond 5 - k points the other way;
/// bonds from kForwardBond on point to higher-numbered points.
struct BondOffset {
  int x, y, z;
};
inline constexpr BondOffset bond_offset(int k) {
  const int axis = k < 3 ? 2 - k : k - 3, sign = k < 3 ? -1 : 1;
  return {axis == 0 ? sign : 0, axis == 1 ? sign : 0, axis == 2 ? sign : 0};
}
inline constexpr int kForwardBond = 3;
inline constexpr int opposite_bond(int k) { return kBondCount - 1 - k; }

/// Clears bond `k` of a point, and the same bond of the other point.
inline void break_bond(int k, std::uint8_t& of_point, std::uint8_t& of_other) {
  of_point &= static_cast<std::uint8_t>(~(1u << k));
  of_other &= static_cast<std::uint8_t>(~(1u << opposite_bond(k)));
}

/// Where a blade went through a bond.
struct Crossing {
  float place;      ///< along the bond, 0 at its lower-numbered point to 1
  float normal[3];  ///< of the cut in reference space, unit, to either side
  TISSUE_SIM_FIELDS(place, normal)
};

/// A bond that an edge passed, from its lower-numbered point along an axis (0 x, 1 y, 2 z), and
/// where: a negative place if that cannot be said.
struct BrokenBond {
  std::int32_t point, other;
  int axis;
  Crossing crossing;
};

// Shares of their stiffness that cells and points keep where there are few of them.

/// Of a cell that holds few points: mpm/blocks/stabilisation.h.
inline constexpr float kStabilisation = 0.01f;
/// A cell with this many points needs none: seven leave no motion loose, while pieces of cells with
/// five or six may have motions thirty times as soft as with stabilisation.
inline constexpr int kSteadyCount = 7;
/// The share of its stiffness that a soft point keeps (mpm/tear/debris.h): its substep is then
/// about that of whole tissue.
inline constexpr float kSoftness = 1.0f / 3;

/// A piece that was cut off with at most this many points, a cell's worth, is a bit of debris.
inline constexpr int kDebrisPoints = 8;

/// What anchors keep of points in cells at their faces (mpm/blocks/fill_region.cpp) is a share
/// kStabilisation, and no larger than this, as little else is [m^3]. Its nodes, which
/// nothing else holds, move by cells; how stiff it is for that is no matter.
TISSUE_SIM_INLINE float kept_volume(float cell_size) {
  const float half = 0.5f * cell_size;
  return 2 * kStabilisation * half * half * half;
}

}  // namespace tissue_sim
