// PLY files (Turk 1994): text, binary of either byte order.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// The vertices and faces of a PLY file's bytes; properties and elements of other names are passed
/// over. Throws std::invalid_argument with a reason that starts with a verb.
TriangleMesh read_ply(const std::string& bytes);

/// The bytes of a binary PLY file [m]: vertices that triangles of one piece share; of each face its
/// `fragment`, whether a `cut` made it, and its colour, of 0x00RRGGBB.
std::string to_ply(const SurfaceTriangles& surface, const std::vector<std::uint32_t>& colours);

}  // namespace tissue_sim
