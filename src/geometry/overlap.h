// Bodies of a scene that lie in one another.
#pragma once

#include <string>
#include <vector>

#include "tissue_sim/scene.h"

namespace tissue_sim {

/// A line for each two bodies that overlap by more than a thousandth of a cell: their names, by
/// which volume, how deep. Exact lengths along lines through the box that both have a part in, of
/// shapes and of closed meshes; an open one has no inside. Throws what reading a mesh throws.
std::vector<std::string> overlap_notes(const Scene& scene);

}  // namespace tissue_sim
