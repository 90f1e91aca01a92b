// How much of each point's volume lies outside its body's anchors: tissue inside is rigid.
#pragma once

#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// Share of a cube that lies outside all `anchors`, and the middle of that share, from the cube's
/// centre in units of its edge. Exact for one plane or box, else by lines through the cube.
struct OutsideShare {
  double share = 1;
  Vec3 middle = Vec3::Zero();
};
OutsideShare share_outside(const std::vector<Anchor>& anchors, const Vec3& center, double edge);

/// Fills Points::free_volume: of each point the volume outside the anchors, so that the sum and the
/// first moments are those of the tissue there. Empty where no body has anchors.
void find_free_volumes(const std::vector<LatticeBody>& bodies, Points& points);

}  // namespace tissue_sim
