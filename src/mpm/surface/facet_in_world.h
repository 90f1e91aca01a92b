// How a facet stands in the world, from the nodes around its cell: the same on the CPU and on the
// GPU. A node field is a functor: field.row(y, z, u) gives u[component][x] of three nodes along x.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/host_device.h"
#include "math/bspline.h"

namespace tissue_sim {

// Facets: the surface of a body in reference space, cut faces included: one for each face on which
// points of a cell have lost, or never had, neighbours (mpm/blocks/known_facets.h).

/// Points of one cell and block whose bonds towards one side are gone.
struct Facet {
  std::int32_t point;      ///< lowest of its points
  std::int32_t cell;       ///< z * plane + y * pitch + x: its cell, and its stencil's lowest node
  std::uint8_t direction;  ///< of a bond that it misses: mpm/lattice/bonds.h
  float center[3];         ///< in cells, from the middle of the cell
  float normal[3];         ///< unit, outward, in reference space
  float extent[3];         ///< half its size along each axis [cells]; 0: none along it
  float area;              ///< [m^2]
  TISSUE_SIM_FIELDS(point, cell, direction, center, normal, extent, area)
};

// A place on the surface of a body: see mpm/surface/surface_places.h.

/// In a block.
struct SurfacePlace {
  std::int32_t cell;  ///< lane of its cell's first point
  std::int32_t node;  ///< lowest of that cell, in the block's nodes
  std::int32_t point;
  std::uint8_t points;  ///< bit s: stands for the surface before the one at sub-position s
  std::uint8_t
      key;          ///< 8 times 1 plus the point's place in the cell (x + 2 y + 4 z), plus the bond
  float place[3];   ///< in cells, from the middle of the cell
  float normal[3];  ///< unit, outward, in reference space
  float area;       ///< [m^2]
  TISSUE_SIM_FIELDS(cell, node, point, points, key, place, normal, area)
};

TISSUE_SIM_INLINE float dot(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Weights of the three nodes of each axis at a place given in cells from the middle of a cell. The
/// cell's own quadratics, in and outside of it.
struct AxisWeights {
  float of[9];  ///< x, y, z

  AxisWeights() = default;
  TISSUE_SIM_INLINE explicit AxisWeights(const float (&place)[3]) {
    for (int i = 0; i < 9; ++i) of[i] = cell_weight(place[i / 3], i % 3);
  }
  /// Of node k of the 27, x fastest.
  TISSUE_SIM_INLINE float at(int k) const { return of[k % 3] * of[3 + k / 3 % 3] * of[6 + k / 9]; }
  TISSUE_SIM_FIELDS(of)
};

/// Slopes of these weights [1/cell].
TISSUE_SIM_INLINE void slopes_at(const float (&place)[3], float (&slope)[9]) {
  for (int a = 0; a < 3; ++a) {
    slope[3 * a] = place[a] - 0.5f;
    slope[3 * a + 1] = -2 * place[a];
    slope[3 * a + 2] = place[a] + 0.5f;
  }
}

/// How a facet stands.
struct FacetMotion {
  float x[3], v[3];       ///< of its centre [m], [m/s]
  float normal[3];        ///< unit, outward, in the world
  float to_reference[9];  ///< inverse of the deformation gradient, row-major
  TISSUE_SIM_FIELDS(x, v, normal, to_reference)
};

/// Value of a node field at a place.
template <class Field>
TISSUE_SIM_INLINE void value_at(const Field& field, const AxisWeights& weights, float (&value)[3]) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  float sum[3] = {};
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      float u[3][3];
      field.row(y, z, u);
      const float w = wz[z] * wy[y];
      for (int c = 0; c < 3; ++c) {
        sum[c] += w * (wx[0] * u[c][0] + wx[1] * u[c][1] + wx[2] * u[c][2]);
      }
    }
  }
  for (int c = 0; c < 3; ++c) value[c] = sum[c];
}

/// Deformation gradient at a place given in cells from the middle of the cell, row-major, from the
/// field of displacements.
template <class Field>
TISSUE_SIM_INLINE void deformation_gradient(const Field& field, double cell_size,
                                            const float (&place)[3], float (&F)[9]) {
  const AxisWeights w(place);
  float slope[9];
  slopes_at(place, slope);
  for (float& f : F) f = 0;  // first the gradient of the displacement, times the cell size
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      float u[3][3];
      field.row(y, z, u);
      const float wx = w.of[3 + y] * w.of[6 + z], wy = slope[3 + y] * w.of[6 + z],
                  wz = w.of[3 + y] * slope[6 + z];
      for (int c = 0; c < 3; ++c) {
        const float value = w.of[0] * u[c][0] + w.of[1] * u[c][1] + w.of[2] * u[c][2];
        F[3 * c] += wx * (slope[0] * u[c][0] + slope[1] * u[c][1] + slope[2] * u[c][2]);
        F[3 * c + 1] += wy * value;
        F[3 * c + 2] += wz * value;
      }
    }
  }
  const auto per_cell = static_cast<float>(1 / cell_size);
  for (int i = 0; i < 9; ++i) F[i] = F[i] * per_cell + (i % 4 == 0 ? 1.0f : 0.0f);
}

/// How a facet stands whose centre has the reference place `place` [m], the displacement u, the
/// velocity v and the deformation gradient F there.
TISSUE_SIM_INLINE FacetMotion facet_motion(const Facet& facet, const double (&place)[3],
                                           const float (&u)[3], const float (&v)[3],
                                           const float (&F)[9]) {
  FacetMotion m;
  for (int a = 0; a < 3; ++a) {
    m.x[a] = static_cast<float>(place[a] + u[a]);
    m.v[a] = v[a];
  }
  // cof F = J F^-T carries normals; its transpose over J is the inverse.
  float cof[9];
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      cof[3 * i + j] = F[3 * i1 + j1] * F[3 * i2 + j2] - F[3 * i1 + j2] * F[3 * i2 + j1];
    }
  }
  const float J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
  const float inv_J = 1 / copysignf(fmaxf(fabsf(J), 1e-3f), J);
  float length = 0;
  for (int i = 0; i < 3; ++i) {
    m.normal[i] = dot(cof + 3 * i, facet.normal);
    length += m.normal[i] * m.normal[i];
    for (int j = 0; j < 3; ++j) m.to_reference[3 * i + j] = cof[3 * j + i] * inv_J;
  }
  const float scale = 1 / sqrtf(fmaxf(length, 1e-20f));
  for (float& n : m.normal) n *= scale;
  return m;
}

/// The same from the fields of displacements and velocities.
template <class Field>
TISSUE_SIM_INLINE FacetMotion facet_motion(const Facet& facet, const double (&place)[3],
                                           double cell_size, const Field& displacement,
                                           const Field& velocity) {
  const AxisWeights weights(facet.center);
  float u[3], v[3], F[9];
  value_at(displacement, weights, u);
  value_at(velocity, weights, v);
  deformation_gradient(displacement, cell_size, facet.center, F);
  return facet_motion(facet, place, u, v, F);
}

}  // namespace tissue_sim
