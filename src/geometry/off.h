// OFF files (Geomview): text, and binary.
#pragma once

#include <string>

#include "geometry/mesh.h"

namespace tissue_sim {

/// The vertices and faces of an OFF file's bytes; colours and normals are passed over. Throws
/// std::invalid_argument with a reason that starts with a verb.
TriangleMesh read_off(const std::string& bytes);

}  // namespace tissue_sim
