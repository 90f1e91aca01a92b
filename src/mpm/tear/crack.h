// A crack as the bonds show it, and where it goes on: see mpm/tear/tear.h for the rule.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/lattice/bonds.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {

inline constexpr int kReach = 3;  ///< half the support of a node [points]

/// Bonds that the point had and lost.
unsigned broken_bonds(const MpmState& state, std::int32_t p);

/// The point that is `steps` on from a site in the direction of bond `k`, -1 where there is none.
std::int32_t neighbour(const LatticeBody& body, const Points::Site& s, int k, int steps = 1);

/// The entry of a point, null if it is not among them.
const TearingPoint* entry(const std::vector<TearingPoint>& tearing, std::int32_t point);

/// Whether a bond broke on the line of bond `k` of p, within kReach of it.
bool broken_on_line(const MpmState& state, const LatticeBody& body, std::int32_t p, int k);

struct Bond {
  std::int32_t point;
  int bond;
  bool bridge;  ///< holds the two sides of a crack together
};

/// Appends the bonds of a point that a crack takes as it goes on. Returns whether there is a crack
/// within kReach.
bool go_on(const MpmState& state, const TearingPoint& t, const std::vector<TearingPoint>& tearing,
           std::vector<Bond>& bonds);

}  // namespace tissue_sim
