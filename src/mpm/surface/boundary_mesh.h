// The surface of tissue as triangles, cut faces included, closed around each piece.
//
// What pushes a vertex goes to the nodes that it moves with, by how it follows them, but for what
// has little mass behind it: a node beside a cut that sees the rim of a point, a shred that hangs
// from an edge. Fluid, which presses by impulses, would throw them at hundreds of metres a second.
// Such a node takes no more than lets it gain what a thin skin under the pushed surface would; the
// other nodes take the rest, so that force and moment stay (the moment in reference space, and
// where there are others enough). A vertex with less behind it than that passes on to those around
// it what it does not take.
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
  /// Which vertices push a node, and with what part of what pushes them: find_support().
  struct Support {
    std::uint64_t made = 0;                  ///< BoundaryMesh::made that it is of
    std::vector<std::int32_t> node, begin;   ///< that move and have vertices; where these begin
    std::vector<std::int32_t> vertex;        ///< of each node, by number
    std::vector<float> share;                ///< beside it
    std::vector<std::int32_t> corner_begin;  ///< of each vertex
    std::vector<std::int32_t> corner;        ///< those of triangles that are there
    struct Weak {
      std::int32_t vertex;
      float takes;              ///< of what pushes it
      std::int32_t begin, end;  ///< in `around`
    };
    std::vector<Weak> weak;
    std::vector<std::int32_t> weak_of;  ///< of each vertex; -1
    struct Neighbour {
      std::int32_t vertex;
      float share;
    };
    std::vector<Neighbour> around;  ///< of the weak: who takes what they do not
  } support;
};

/// Makes the mesh anew if bonds broke since. Throws what find_outer_places() throws.
void update_boundary(const LatticeTissue& tissue, BoundaryMesh& mesh);

/// Makes BoundaryMesh::support anew where the mesh is another one.
void find_support(const LatticeTissue& tissue, BoundaryMesh& mesh);

/// What the weak vertices do not take of what pushes them goes to those around them.
void pass_on(const BoundaryMesh::Support& support, std::vector<std::array<float, 3>>& push);

}  // namespace tissue_sim
