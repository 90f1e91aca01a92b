// Gaps within a mesh's solid: which lattice neighbours are no neighbours, for void lies between.
#pragma once

#include "geometry/lattice.h"
#include "geometry/mesh.h"

namespace tissue_sim {

/// Fills Lattice::gaps: of neighbours whose parts of the solid do not meet within their two cubes.
/// A cube in which several parts lie belongs to the largest of them; what it has of another one
/// goes to a neighbour that has more of that, so each side of a gap keeps its volume. Where no two
/// faces of the mesh look at each other within two cubes nothing is asked, which is most of a body.
/// Faces are met by lines four to a cube along each axis: a gap is found however narrow, a bridge
/// across it thinner than a quarter of a cube may not be.
void find_gaps(const TriangleMesh& mesh, Lattice& lattice);

}  // namespace tissue_sim
