// Where facets are in the world, and the places and weights that contact between faces works with.
#pragma once

#include <cstdint>
#include <vector>

#include "math/bspline.h"
#include "mpm/block.h"
#include "mpm/lattice_body.h"
#include "mpm/nodes.h"

namespace tissue_sim {

/// Weights of the three nodes of each axis at a place given in cells from the middle of a cell. The
/// cell's own quadratics, in and outside of it.
struct AxisWeights {
  float of[9];  ///< x, y, z

  AxisWeights() = default;
  explicit AxisWeights(const float (&place)[3]) {
    for (int i = 0; i < 9; ++i) of[i] = cell_weight(place[i / 3], i % 3);
  }
};

/// The 27 nodes around a cell, as its block sees them.
struct CellNodes {
  const std::int32_t* lowest;
  int pitch, plane;

  CellNodes() = default;
  CellNodes(const Block& block, int cell)
      : lowest(block.node.data() + cell), pitch(block.pitch), plane(block.plane) {}
};

/// Value of a node field at a place.
inline void value_at(const Array<float>* field, const CellNodes& nodes, const AxisWeights& weights,
                     float (&value)[3]) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  float sum[3] = {};
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      const std::int32_t* n = nodes.lowest + z * nodes.plane + y * nodes.pitch;
      const float w = wz[z] * wy[y];
      for (int c = 0; c < 3; ++c) {
        const float* u = field[c].data();
        sum[c] += w * (wx[0] * u[n[0]] + wx[1] * u[n[1]] + wx[2] * u[n[2]]);
      }
    }
  }
  for (int c = 0; c < 3; ++c) value[c] = sum[c];
}

/// Deformation gradient at a place given in cells from the middle of the cell, row-major.
void deformation_gradient_at(const Array<float>* u, const CellNodes& nodes, double cell_size,
                             const float (&place)[3], float (&F)[9]);

/// How a facet stands.
struct FacetMotion {
  float x[3], v[3];       ///< of its centre [m], [m/s]
  float normal[3];        ///< unit, outward, in the world
  float to_reference[9];  ///< inverse of the deformation gradient, row-major
};

/// Reference place of a facet's centre [m].
Vec3 reference_place(const LatticeBody& body, const Block& block, const Facet& facet);

/// Reference place of a place given in cells from the middle of a facet's cell [m].
Vec3 reference_place(const LatticeBody& body, const Block& block, int cell,
                     const float (&place)[3]);

FacetMotion facet_motion(const LatticeBody& body, const Block& block, const Facet& facet,
                         const Nodes& nodes);

}  // namespace tissue_sim
