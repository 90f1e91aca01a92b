// PLY files (Turk 1994): text, binary of either byte order.
#pragma once

#include <string>

#include "geometry/mesh.h"

namespace tissue_sim {

/// The vertices and faces of a PLY file's bytes; properties and elements of other names are passed
/// over. Throws std::invalid_argument with a reason that starts with a verb.
TriangleMesh read_ply(const std::string& bytes);

}  // namespace tissue_sim
