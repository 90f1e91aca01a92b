// OBJ files (Wavefront): places and faces; what they look like is passed over, and no other file is
// opened for it.
#pragma once

#include <string>

#include "geometry/mesh.h"

namespace tissue_sim {

/// The vertices and faces of an OBJ file's bytes. Throws std::invalid_argument with a reason that
/// starts with a verb.
TriangleMesh read_obj(const std::string& bytes);

}  // namespace tissue_sim
