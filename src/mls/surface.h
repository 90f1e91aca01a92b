// The surface of meshless tissue as triangles: of the cubes that are nearest to each node.
#pragma once

#include <cstdint>
#include <vector>

#include "mls/state.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A body is seen as cubes of the nodes' spacing (geometry/contour.h). Each belongs to the nearest
/// node; two hold on to one another where both have one node or no cut passes between theirs.
struct MlsSurface {
  struct Cube {
    std::int32_t x, y, z;
    std::int32_t node;
    std::uint8_t whole;  ///< sides beyond which tissue went on while nothing was cut
  };
  struct Lattice {
    Vec3 origin;
    double edge;              ///< [m]
    std::int32_t begin, end;  ///< of its cubes, which are by z, y, x
  };
  struct Plane {  ///< of the body's true surface, beside a cube's side
    std::int32_t cube;
    int side;
    Vec3 place, normal;  ///< in cubes
  };
  /// Moves with its nodes: each tells where it goes, as it sees its surroundings deform.
  struct Vertex {
    Vec3 rest;  ///< [m]
    std::int32_t node[8];
    float weight[8];  ///< add up to 1; 0 where there are fewer
  };
  struct Face {
    std::int32_t vertex[4];
    std::int32_t point;  ///< the node of its cube
    std::uint8_t cut;
  };
  std::vector<Lattice> bodies;  ///< empty until it is asked for
  std::vector<Cube> cubes;
  std::vector<std::int16_t> body;  ///< of each
  std::vector<Plane> outer;
  std::vector<Vertex> vertices;
  std::vector<Face> faces;
  Array<std::uint8_t> crossed;  ///< of the pairs, when the faces were made
};

/// Replaces `out` with the surface of the nodes as they are; `piece` tells each one's. Keeps in
/// `surface` what holds until something is cut. Throws what make_lattice() throws.
void read_surface(const MlsState& state, const std::vector<std::int32_t>& piece,
                  MlsSurface& surface, SurfaceTriangles& out);

}  // namespace tissue_sim
