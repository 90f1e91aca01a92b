// The parts of a closed triangle mesh: what is connected across edges.
#pragma once

#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

/// Leaves parts without volume out, with a note, unless the mesh is nothing else: as parts, voids
/// or parts inside out they would be counted, and mean nothing.
void drop_slivers(TriangleMesh& mesh, std::vector<std::string>& notes);

/// Turns parts that are inside out around, with a note: outermost ones must face outwards, and what
/// lies in them turns with them. Notes, too, which parts are apart, voids, or without effect.
void turn_outwards(TriangleMesh& mesh, std::vector<std::string>& notes);

/// The solids that a mesh as make_solid() leaves it consists of, each with its voids; parts that
/// overlap are one. What is apart, by however little, is in two.
std::vector<TriangleMesh> separate_solids(const TriangleMesh& mesh);

}  // namespace tissue_sim
