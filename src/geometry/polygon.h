// Faces with many corners.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

constexpr std::size_t kMostCorners = 1000;  ///< of a face

/// Adds a face with these corners to the mesh's triangles: convex ones as a fan, others by cutting
/// off ears (Meisters 1975). Faces of less than three corners bound nothing and are left out.
/// Throws std::invalid_argument, with a verb in front, for corners that the mesh has not, or more
/// than kMostCorners.
void add_polygon(TriangleMesh& mesh, const std::vector<double>& corners);

}  // namespace tissue_sim
