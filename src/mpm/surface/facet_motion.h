// Where facets are in the world, and the places that contact between faces works with, on the CPU.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/simd.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/surface/block.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

/// The 27 nodes around a cell, as its block sees them.
struct CellNodes {
  const std::int32_t* lowest;
  int pitch, plane;

  CellNodes() = default;
  CellNodes(const Block& block, int cell)
      : lowest(block.node.data() + cell), pitch(block.pitch), plane(block.plane) {}
  /// Three nodes along x.
  const std::int32_t* row(int y, int z) const { return lowest + z * plane + y * pitch; }
};

/// A node field around a cell: see mpm/surface/facet_in_world.h.
struct CellField {
  const Array<float>* of;  ///< its three components
  CellNodes nodes;

  TISSUE_SIM_INLINE void row(int y, int z, float (&u)[3][3]) const {
    const std::int32_t* n = nodes.row(y, z);
    for (int c = 0; c < 3; ++c) {
      for (int x = 0; x < 3; ++x) u[c][x] = of[c][n[x]];
    }
  }
};

/// Adds a force at a place in a cell to the force on the block's nodes, [3][nz + 2][plane].
inline void spread(const Block& block, int cell, const AxisWeights& weights, const float (&push)[3],
                   float* force) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  const Vec<4> along_x = {wx[0], wx[1], wx[2], 0.0f};  // the fourth node stays as it is
  const Vec<4> push_x[3] = {push[0] * along_x, push[1] * along_x, push[2] * along_x};
  const int component = block.node_count(), pitch = block.pitch, plane = block.plane;
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      float* to = force + cell + z * plane + y * pitch;
      const float w = wz[z] * wy[y];
      for (int c = 0; c < 3; ++c, to += component) store<4>(to, load<4>(to) + w * push_x[c]);
    }
  }
}

/// Deformation gradient at a place given in cells from the middle of the cell, row-major.
void deformation_gradient_at(const Array<float>* u, const CellNodes& nodes, double cell_size,
                             const float (&place)[3], float (&F)[9]);

/// Reference place of a place given in cells from the middle of a facet's cell [m].
Vec3 reference_place(const LatticeBody& body, const Block& block, int cell,
                     const float (&place)[3]);

FacetMotion facet_motion(const LatticeBody& body, const Block& block, const Facet& facet,
                         const Nodes& nodes);

}  // namespace tissue_sim
