// A surface across a loop in space: what closes a wound.
#pragma once

#include <array>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {
namespace pbd {

struct CapMesh {
  std::vector<Vec3> inner;  ///< vertices within, [m]; those of the loop come before them
  std::vector<std::array<int, 3>> triangles;  ///< in the loop's sense
  /// Of each inner vertex, the shares of the loop's vertices in it (mean value coordinates, Floater
  /// 2003): sum to 1.
  std::vector<std::vector<double>> weights;
};

/// Triangulates a simple loop seen along its mean normal (ears, then flips to Delaunay), with inner
/// vertices about `edge` apart. The inside follows the `sheets` that a blade left, edges (a, b) at
/// the beginning and at the end of each; where there are none it rises and falls with the loop. No
/// triangles where the loop crosses itself or has no area.
CapMesh fill_loop(const std::vector<Vec3>& loop, double edge,
                  const std::vector<std::array<Vec3, 4>>& sheets = {});

/// Rings of vertices about `edge` apart, each nearer to the middle, and at last one vertex, `rise`
/// [m] above it: a surface that a loop has, too, that crosses itself where it is seen along its
/// normal.
CapMesh fill_by_rings(const std::vector<Vec3>& loop, double edge, double rise);

/// Flips edges and moves inner vertices towards those around, where that widens the smallest angle
/// there: what is Delaunay seen along the normal may have slivers in space.
void widen_angles(const std::vector<Vec3>& loop, CapMesh& cap);

}  // namespace pbd
}  // namespace tissue_sim
