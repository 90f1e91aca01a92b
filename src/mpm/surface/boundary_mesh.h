// The surface of tissue as triangles, cut faces included, closed around each piece.
//
// A bond that a point misses is a side of its cube where tissue ends (geometry/contour.h); the
// planes are those of the true surface or of the blade. A vertex moves with the nodes as one of its
// points sees them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

struct BoundaryMesh {
  struct Vertex {
    std::int32_t point;     ///< in whose cell it is: one that moves, where any there does
    float place[3];         ///< in cells, from the middle of the cell
    Vec3 rest;              ///< the same, in the world at time zero [m]
    std::int32_t node[27];  ///< around the cell, x fastest, as the point sees them
  };
  struct Face {
    std::int32_t vertex[4];  ///< counter-clockwise seen from outside; 0 and 2 are joined
    std::int32_t point;
    std::uint8_t cut;  ///< whether tissue went on there while it was whole
  };
  std::uint64_t made = 0;   ///< how often
  std::uint64_t shown = 0;  ///< SurfaceTriangles::made of what shows it, as it is and in its pieces
  std::vector<Vertex> vertices;
  std::vector<std::array<float, 3>> now;  ///< where each was when they were read last [m]
  std::vector<Face> faces;                ///< by their points
  Array<std::uint8_t> bonds;              ///< of the points, when it was made
  std::vector<OuterPlace> outer;          ///< where the points have none: on a GPU
};

/// Makes the mesh anew if bonds broke since. Throws what find_outer_places() throws.
void update_boundary(const LatticeTissue& tissue, BoundaryMesh& mesh);

}  // namespace tissue_sim
