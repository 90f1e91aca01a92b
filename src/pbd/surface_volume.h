// What surfaces enclose that need not be closed.
#pragma once

#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {
namespace pbd {

/// What a part of a surface, triangles that share vertices, encloses.
struct SurfacePart {
  std::vector<int> triangles;
  double area = 0;    ///< [m^2]
  double volume = 0;  ///< signed, with each hole closed by a fan around its rim's centre [m^3]
  double fans = 0;    ///< area of those [m^2]
  int holes = 0;
  /// No body with a hole: what would close it is nearly as large as what is there (half a ball's is
  /// half of it, a sheet's all).
  bool is_sheet() const { return fans > 0.6 * area; }
};
std::vector<SurfacePart> surface_parts(const TriangleMesh& mesh);

/// Leaves parts of next to no area and volume out, a doubled triangle or what a reader's merging
/// left, with a note; as pieces of their own they would cost all that pieces do.
void drop_specks(TriangleMesh& mesh, std::vector<std::string>& notes);

}  // namespace pbd
}  // namespace tissue_sim
