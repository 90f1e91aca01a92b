// Debris: pieces that are too small to be seen as bodies, but whose vibration would set the substep
// of all the tissue.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "mpm/blocks/stabilisation.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/tear/debris_points.h"

namespace tissue_sim {

/// Marks what became soft as the points `changed` lost bonds: those of debris, and of slices one
/// point thick, which cuts parted from what there was on both sides of them along an axis of the
/// lattice. They keep the share kSoftness of their stiffness.
struct Softened {
  std::vector<std::int32_t> points;
  std::vector<std::int32_t> debris;  ///< lowest point of each, whether it was one before or not
};
Softened soften(LatticeTissue& tissue, const std::vector<std::int32_t>& changed);

/// The volume by which a point resists strain [m^3]: its own, or less where it is soft.
inline float elastic_volume(const Points& points, std::int32_t point) {
  return (points.is_soft(point) ? kSoftness : 1.0f) * points.free_volume_of(point);
}

/// Lets debris, each given by its lowest point, move on as rigid bodies without strain. Their
/// momentum stays, linear and angular; what else a torn bridge left in their nodes, a swing of many
/// times their size, goes. No bit of debris turns faster than kDebrisSpin times the speed of sound
/// in a rod a cell, which strains it by a tenth or two: the rest goes to the tissue beside it.
void settle_debris(LatticeTissue& tissue, const std::vector<std::int32_t>& debris);
/// The same for those that have become wild since (mpm/tear/deformation.h). Returns their points.
std::vector<std::int32_t> settle_wild_debris(LatticeTissue& tissue,
                                             const std::set<std::int32_t>& debris);
inline constexpr double kDebrisSpin = 0.5;

/// Sets the nodes of a point turning, so that they have so much more angular momentum [kg m^2/s].
void turn(LatticeTissue& tissue, std::int32_t point, const Vec3& angular);

}  // namespace tissue_sim
