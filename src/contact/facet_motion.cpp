#include "contact/facet_motion.h"

#include <cmath>

namespace tissue_sim {

void deformation_gradient_at(const Array<float>* u, const CellNodes& nodes, double cell_size,
                             const float (&place)[3], float (&F)[9]) {
  const AxisWeights w(place);
  float slope[9];
  for (int a = 0; a < 3; ++a) {
    slope[3 * a] = place[a] - 0.5f;
    slope[3 * a + 1] = -2 * place[a];
    slope[3 * a + 2] = place[a] + 0.5f;
  }
  for (float& f : F) f = 0;  // first the gradient of the displacement, times the cell size
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      const std::int32_t* n = nodes.lowest + z * nodes.plane + y * nodes.pitch;
      const float wx = w.of[3 + y] * w.of[6 + z], wy = slope[3 + y] * w.of[6 + z],
                  wz = w.of[3 + y] * slope[6 + z];
      for (int c = 0; c < 3; ++c) {
        const float u0 = u[c][n[0]], u1 = u[c][n[1]], u2 = u[c][n[2]];
        const float value = w.of[0] * u0 + w.of[1] * u1 + w.of[2] * u2;
        F[3 * c] += wx * (slope[0] * u0 + slope[1] * u1 + slope[2] * u2);
        F[3 * c + 1] += wy * value;
        F[3 * c + 2] += wz * value;
      }
    }
  }
  const auto per_cell = static_cast<float>(1 / cell_size);
  for (int i = 0; i < 9; ++i) F[i] = F[i] * per_cell + (i % 4 == 0 ? 1.0f : 0.0f);
}

Vec3 reference_place(const LatticeBody& body, const Block& block, int cell,
                     const float (&place)[3]) {
  const int z = cell / block.plane, y = cell % block.plane / block.pitch,
            x = cell % block.plane % block.pitch;
  return body.node_position(block.x + x, block.y + y, block.z + z) +
         body.cell_size * Vec3(place[0], place[1], place[2]);
}

Vec3 reference_place(const LatticeBody& body, const Block& block, const Facet& facet) {
  return reference_place(body, block, facet.cell, facet.center);
}

FacetMotion facet_motion(const LatticeBody& body, const Block& block, const Facet& facet,
                         const Nodes& nodes) {
  FacetMotion m;
  const CellNodes cell(block, facet.cell);
  const AxisWeights weights(facet.center);
  float u[3];
  value_at(nodes.u, cell, weights, u);
  value_at(nodes.v, cell, weights, m.v);
  const Vec3 place = reference_place(body, block, facet);
  for (int a = 0; a < 3; ++a) m.x[a] = static_cast<float>(place[a] + u[a]);
  float F[9];
  deformation_gradient_at(nodes.u, cell, body.cell_size, facet.center, F);
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
  const float inv_J = 1 / std::copysign(std::fmax(std::fabs(J), 1e-3f), J);
  float length = 0;
  for (int i = 0; i < 3; ++i) {
    m.normal[i] = cof[3 * i] * facet.normal[0] + cof[3 * i + 1] * facet.normal[1] +
                  cof[3 * i + 2] * facet.normal[2];
    length += m.normal[i] * m.normal[i];
    for (int j = 0; j < 3; ++j) m.to_reference[3 * i + j] = cof[3 * j + i] * inv_J;
  }
  const float scale = 1 / std::sqrt(std::fmax(length, 1e-20f));
  for (float& n : m.normal) n *= scale;
  return m;
}

}  // namespace tissue_sim
