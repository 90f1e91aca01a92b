// The cells of a file of a volume mesh, of all kinds, and what becomes of them.
#pragma once

#include <array>
#include <string>

#include "geometry/tet_mesh.h"

namespace tissue_sim {

enum class CellKind {
  kPoint,
  kLine,
  kTriangle,
  kQuadrilateral,
  kTetrahedron,
  kHexahedron,
  kVoxel,  ///< a hexahedron whose corners VTK counts row by row
  kWedge,
  kPyramid,
  kOther
};

struct VolumeCells {
  TetMesh mesh;
  std::array<int, 10> counts{};  ///< by kind, as the file has them

  /// Takes a tetrahedron or hexahedron by its first corners, of higher order, too; counts others.
  /// A hexahedron becomes six tetrahedra: its lowest corner with each half of the faces opposite,
  /// which are halved at their lowest corners, so that neighbours halve a face alike.
  void add(CellKind kind, const int* corners, int count);
  /// What the file has beside tetrahedra, with a verb in front; "" for nothing.
  std::string note() const;
};

/// Readers: a legacy VTK file of an unstructured grid, VTK's XML file of one, Gmsh's file. Throw
/// std::invalid_argument, with a verb in front, for bytes that are none.
VolumeCells read_vtk(const std::string& bytes);
VolumeCells read_vtu(const std::string& bytes);
VolumeCells read_gmsh(const std::string& bytes);

/// VTK's number of a cell's type.
CellKind vtk_cell(int type);

}  // namespace tissue_sim
