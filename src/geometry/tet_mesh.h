// Tetrahedral meshes: read, checked, or made from a closed surface.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

struct TetMesh {
  std::vector<Vec3> vertices;                  ///< [m]
  std::vector<std::array<int, 4>> tetrahedra;  ///< positive: (b - a) x (c - a) . (d - a) > 0
};

/// Whether a path's extension is that of a volume mesh: .msh, .vtk, .vtu, .mesh, .node or .ele.
bool is_tet_file(const std::string& path);

/// Reads Gmsh's .msh (2 and 4.1), a legacy .vtk or a .vtu of an unstructured grid, each as text or
/// binary, Medit's .mesh or TetGen's .node and .ele (either names both) as text. Hexahedra become
/// six tetrahedra each, other cells are left out, and a note says so. Throws std::invalid_argument
/// for what is missing, unreadable, or has indices or coordinates that cannot be.
TetMesh read_tets(const std::string& path, std::vector<std::string>* notes = nullptr);

/// Turns inverted tetrahedra around and drops vertices that none has; notes say which, by their
/// number in the file (from 0). Throws std::invalid_argument for flat ones, by number: six times
/// the volume below 1e-6 of the longest edge cubed.
void check_tets(TetMesh& mesh, std::vector<std::string>& notes);

double volume(const TetMesh& mesh, int tetrahedron);  ///< [m^3], signed
double volume(const TetMesh& mesh);                   ///< [m^3]
/// Smallest dihedral angle of a tetrahedron [rad].
double smallest_dihedral(const TetMesh& mesh, int tetrahedron);

/// Triangles of the boundary, facing outwards.
std::vector<std::array<int, 3>> boundary(const TetMesh& mesh);

/// A box from -size / 2 to size / 2 in body-centred cubes of about `edge`, which fill it exactly.
TetMesh tetrahedralize_box(const Vec3& size, double edge);

/// Fills a closed surface with tetrahedra of a body-centred cubic lattice whose long edges are
/// `edge`; at the surface lattice points move onto it or tetrahedra are cut (isosurface stuffing,
/// Labelle and Shewchuk 2007). Edges and corners of the surface are rounded by less than an edge.
/// Throws std::invalid_argument where nothing lies inside.
TetMesh stuff_surface(const TriangleMesh& surface, double edge);

/// The tetrahedra of a file as they stand in it: read and checked, those given twice left out; with
/// notes, faces that neighbours do not share as they should are looked for. Throws
/// std::invalid_argument.
TetMesh load_tet_file(const std::string& path, std::vector<std::string>* notes);

/// The tetrahedra of a body in world axes: those of its file if that has any, else made from its
/// surface. Throws std::invalid_argument.
TetMesh load_tets(const Body& body, double edge, std::vector<std::string>* notes);

}  // namespace tissue_sim
