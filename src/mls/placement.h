// Where the nodes of one body go.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/near_gaps.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Whether a body's nodes are the vertices of a tetrahedral mesh.
bool has_given_nodes(const Body& body);

struct PlacedNode {
  Vec3 place;            ///< [m]
  double volume = 0;     ///< its share of the body [m^3]
  bool surface = false;  ///< whether that reaches the body's surface
  int part = -1;         ///< lowest vertex of what it hangs together with in a tetrahedral mesh
};

/// Pairs of nodes, by their numbers within the body, that an edge of its tetrahedral mesh joins.
using MlsMeshEdges = std::vector<std::array<std::int32_t, 2>>;

/// Nodes `spacing` apart, on a lattice or graded, as the options say; `seed` scatters them. Of a
/// tetrahedral mesh its vertices instead, each with a quarter of its tetrahedra; those that are
/// much nearer to one another than usual go together, with a note. Throws what make_lattice() and
/// load_tets() throw. `gaps` becomes those of the body's mesh, but for a tetrahedral one, which
/// joins what its `edges` join.
std::vector<PlacedNode> place_nodes(const Body& body, const MlsOptions& options, double spacing,
                                    std::uint64_t seed, std::vector<std::string>* notes,
                                    NearGaps& gaps, MlsMeshEdges& edges);

}  // namespace tissue_sim
