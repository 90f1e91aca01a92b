// Crumbs: pieces that are too small to be seen as bodies, but whose vibration would set the substep
// of all the tissue.
#pragma once

#include <cstdint>

#include "mpm/lattice_body.h"

namespace tissue_sim {

/// A piece that was cut off with at most this many points, a cell's worth, is a crumb ...
inline constexpr int kCrumbPoints = 8;
/// ... and keeps this share of its stiffness: its substep is then about that of whole tissue.
inline constexpr float kCrumbStiffness = 1.0f / 3;

/// The volume by which a point resists strain [m^3]: its own, or less in a crumb. A point with all
/// its bonds is never taken for one of a crumb.
float elastic_volume(const LatticeBody& body, const Points& points, std::int32_t point);

}  // namespace tissue_sim
