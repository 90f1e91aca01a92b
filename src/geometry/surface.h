// Surfaces as they are: open, with holes, with edges that many triangles share; and those of a
// scene's shapes, triangulated.
#pragma once

#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

/// The surface of a box, ball, ellipsoid or cylinder in world axes: closed, facing outwards, with
/// edges of about `edge` metres.
TriangleMesh triangulate(const Body& body, double edge);

/// What a surface is like.
struct SurfaceKind {
  int open_edges = 0;     ///< of one triangle only
  int crowded_edges = 0;  ///< of more than two
  int parts = 0;          ///< that share no vertex
  bool is_closed() const { return open_edges == 0 && crowded_edges == 0; }
};

/// Tidies a surface for a method that needs no inside: leaves out triangles without area, those
/// given twice and vertices that no triangle has; turns triangles so that neighbours face the same
/// way and parts outwards (by the volume that they enclose with their own centre). Notes say how
/// many, with a verb in front. Throws std::invalid_argument for a surface without triangles.
SurfaceKind tidy_surface(TriangleMesh& mesh, std::vector<std::string>& notes);

/// The surface of a mesh body in world axes: resolved, read, scaled, tidied, posed. Throws
/// std::invalid_argument, also for a size below 1 mm or above 10 m.
TriangleMesh load_surface(const Body& body, SurfaceKind& kind, std::vector<std::string>* notes);

}  // namespace tissue_sim
