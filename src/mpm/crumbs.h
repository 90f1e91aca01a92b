// Crumbs: pieces that are too small to be seen as bodies, but whose vibration would set the substep
// of all the tissue.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "cutting/node_fields.h"
#include "mpm/lattice_body.h"
#include "mpm/nodes.h"

namespace tissue_sim {

/// A piece that was cut off with at most this many points, a cell's worth, is a crumb ...
inline constexpr int kCrumbPoints = 8;
/// ... and keeps this share of its stiffness: its substep is then about that of whole tissue.
inline constexpr float kCrumbStiffness = 1.0f / 3;

/// The volume by which a point resists strain [m^3]: its own, or less in a crumb. A point with all
/// its bonds is never taken for one of a crumb.
float elastic_volume(const LatticeBody& body, const Points& points, std::int32_t point);

/// Lets the crumbs that a cut or tear made of the points `changed` move on as rigid bodies without
/// strain. Their momentum stays, linear and angular; what else a torn thread left in their nodes, a
/// swing of many times their size, goes. Adds the lowest point of each to `crumbs`. No crumb turns
/// faster than kCrumbSpin wave speeds a cell.
void settle_crumbs(const std::vector<LatticeBody>& bodies, const Points& points,
                   const NodeFields& fields, const std::vector<std::int32_t>& changed,
                   std::set<std::int32_t>& crumbs, Nodes& nodes);
/// The same for those that have become wild since (mpm/deformation.h). Returns whether any had.
bool settle_wild_crumbs(const std::vector<LatticeBody>& bodies, const Points& points,
                        const NodeFields& fields, const std::set<std::int32_t>& crumbs,
                        Nodes& nodes);
inline constexpr double kCrumbSpin = 0.5;

}  // namespace tissue_sim
