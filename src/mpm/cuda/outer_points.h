// Where points on a GPU touch tools: at the true surface of their body.
#pragma once

#include <vector_types.h>

#include <vector>

#include "mpm/lattice_tissue.h"

namespace tissue_sim {

/// Of each point, while the bodies are whole: the place at which colliders touch it, in cells from
/// the middle of its cell, as long as it has the number of bonds that is the fourth figure: where
/// it lost one it is touched itself. 0 for a point that has neighbours all around. Where the body's
/// surface is flat around the point that is straight before it, at an edge on the edge: the point's
/// place is brought onto the surface that each of its missing bonds stands for
/// (mpm/contact/surface_places.h). Throws what find_outer_places() throws.
std::vector<float4> outer_points(const LatticeTissue& tissue);

}  // namespace tissue_sim
