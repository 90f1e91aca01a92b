// Poses and paths of blades that make no sense are refused before anything moves.
#pragma once

#include <string>

#include "tissue_sim/cut.h"

namespace tissue_sim {

/// Throws std::invalid_argument for a pose, called `what`, that is not finite, no rotation or more
/// than 1e6 m from the origin.
void check_pose(const Pose& pose, const std::string& what);

}  // namespace tissue_sim
