// Internal shape-preserving constraints: which vertices they join (Lee et al. 2022, algorithm 2).
#pragma once

#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {
namespace pbd {

struct InternalLink {
  int from, to;              ///< vertices
  double length;             ///< of the ray, from the vertex to where it leaves the body [m]
  bool through_gap = false;  ///< void lies between the two
};

/// Outward unit normals of vertices: those of their triangles, weighted by area. Zero for a vertex
/// without triangles.
std::vector<Vec3> vertex_normals(const TriangleMesh& mesh);

/// From each of the `starts` a ray runs against the vertex's normal to the first triangle that it
/// leaves the body through; the link leads to the nearest of that triangle's vertices, or where
/// three end there already to one nearby where fewer do. Those whose ray meets nothing, as at a
/// hole, have none. In the order of `starts`; a pair that
/// two rays find is in it twice (remove_duplicates does what the algorithm's last lines do).
/// `lean`, if any, is added to the direction of each start's ray: away from a wound beside it.
/// What it meets within `least_depth` [m] is no end: the other wall of a wound lies on the one that
/// the ray begins at.
std::vector<InternalLink> find_internal_links(const TriangleMesh& mesh,
                                              const std::vector<int>& starts,
                                              const std::vector<Vec3>& lean = {},
                                              double least_depth = 0);

}  // namespace pbd
}  // namespace tissue_sim
