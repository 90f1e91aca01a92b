// Closed triangle meshes: found, read, checked and repaired.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "tissue_sim/scene.h"

namespace tissue_sim {

struct TriangleMesh {
  std::vector<Vec3> vertices;                 ///< [m]
  std::vector<std::array<int, 3>> triangles;  ///< counter-clockwise seen from outside
};

/// The file that a plain path, a file:// or a package:// address means. Packages are looked for as
/// rospack does, below the folders of ROS_PACKAGE_PATH, then in `share/<package>` of
/// CMAKE_PREFIX_PATH. Throws std::invalid_argument for other addresses and unknown packages, with
/// `kind` ("mesh", "scene") in front; whether the file exists is not asked.
std::string resolve_path(const std::string& address, const std::string& kind);

/// Reads an STL, OBJ, PLY or OFF file; vertices at the same place become one, triangles without
/// area by that and vertices that no triangle uses are dropped. Throws std::invalid_argument for
/// what is missing, unreadable, without triangles, or has coordinates that are not finite.
TriangleMesh read_mesh(const std::string& path);

/// Merges vertices not farther apart than `distance` and drops the triangles that this collapses.
void merge_vertices(TriangleMesh& mesh, double distance);

/// Drops the vertices that no triangle uses: they would count in boxes.
void drop_unused_vertices(TriangleMesh& mesh);

/// Makes the mesh the boundary of a solid: winding number above 0 is inside. Repairs, with a note,
/// what can be meant only one way: vertices that almost coincide, triangles given twice, single
/// triangles or whole parts that face the wrong way, parts without volume (left out). Parts may be
/// apart, overlap (their union counts) or lie within each other (facing inwards: a void). Throws
/// std::invalid_argument for a surface that is open or has no inside. Errors and notes start with a
/// verb ("has 3 open edges").
void make_solid(TriangleMesh& mesh, std::vector<std::string>& notes);

/// Six times the volume between a triangle and a place, above 0 where the triangle faces away from
/// it.
double six_volumes(const TriangleMesh& mesh, const std::array<int, 3>& triangle,
                   const Vec3& origin);

/// Volume that the surface encloses, by the divergence theorem; negative when inside out [m^3].
double signed_volume(const TriangleMesh& mesh);

/// "did you forget scale: 0.001?" for a mesh of `size` [m] at `scale` that no organ has, below 5 mm
/// or above 2 m, where another unit makes it one; else "".
std::string scale_hint(double size, double scale);

/// Of the vertices of a body's file: notes a size that no organ has, and a place far from the
/// world's origin that comes from the file's own. Throws std::invalid_argument, `what` in front,
/// for a size (longest edge of the bounding box) below 1 mm or above 10 m.
void check_size(const std::string& what, const std::vector<Vec3>& vertices, const Body& body,
                std::vector<std::string>& notes);

/// Whether the body's solid is a mesh: load_solid().
inline bool is_meshed(const Body& body) { return body.shape == Shape::kMesh || body.wall > 0; }

/// The surface of a body's hollow, facing away from it; in world axes. Throws
/// std::invalid_argument for a wall that leaves none of a mesh.
TriangleMesh hollow_of(const Body& body);

/// The solid of a mesh or hollow body in world axes: resolved, read, scaled, checked, repaired,
/// posed; of tetrahedra what their surface encloses. Throws std::invalid_argument, what
/// check_size() throws as well. `look`, if given, sees the posed mesh before checks and repairs,
/// which take long: it may throw.
TriangleMesh load_solid(const Body& body, std::vector<std::string>* notes,
                        const std::function<void(const TriangleMesh&)>& look = {});

}  // namespace tissue_sim
