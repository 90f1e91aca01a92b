#include "mpm/surface/facet_motion.h"

#include <algorithm>

#include "compute/simd.h"

namespace tissue_sim {

namespace {

/// How a place in a cell stands.
struct PlaceMotion {
  float u[3], v[3] = {}, F[9];
};

/// The three nodes of a row side by side: what is summed over rows waits for the weights along x
/// until the end. `kMoves`: with velocities.
template <bool kMoves>
PlaceMotion motion_at(const Array<float>* u, const Array<float>* v, const CellNodes& cell,
                      double cell_size, const float (&place)[3]) {
  const AxisWeights weights(place);
  float slopes[9];
  slopes_at(place, slopes);
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  Vec<4> sum[3] = {}, along_y[3] = {}, along_z[3] = {}, velocity[3] = {};
  for (int z = 0; z < 3; ++z) {
    for (int y = 0; y < 3; ++y) {
      const std::int32_t* row = cell.row(y, z);
      const bool is_whole = row[1] == row[0] + 1 && row[2] == row[0] + 2;
      const auto of_row = [row, is_whole](const Array<float>& field) {
        const float* f = field.data();
        return is_whole ? load<4>(f + row[0]) : Vec<4>{f[row[0]], f[row[1]], f[row[2]], 0.0f};
      };
      const float w = wz[z] * wy[y], dy = wz[z] * slopes[3 + y], dz = slopes[6 + z] * wy[y];
      for (int c = 0; c < 3; ++c) {
        const Vec<4> of_u = of_row(u[c]);
        sum[c] += w * of_u;
        along_y[c] += dy * of_u;
        along_z[c] += dz * of_u;
        if (kMoves) velocity[c] += w * of_row(v[c]);
      }
    }
  }
  const auto per_cell = static_cast<float>(1 / cell_size);
  const auto along_x = [](const float* w, const Vec<4>& of) {
    return w[0] * of[0] + w[1] * of[1] + w[2] * of[2];
  };
  PlaceMotion m;
  for (int c = 0; c < 3; ++c) {
    m.u[c] = along_x(wx, sum[c]);
    m.v[c] = along_x(wx, velocity[c]);
    m.F[3 * c] = per_cell * along_x(slopes, sum[c]);
    m.F[3 * c + 1] = per_cell * along_x(wx, along_y[c]);
    m.F[3 * c + 2] = per_cell * along_x(wx, along_z[c]);
    m.F[4 * c] += 1;
  }
  return m;
}

}  // namespace

void deformation_gradient_at(const Array<float>* u, const CellNodes& nodes, double cell_size,
                             const float (&place)[3], float (&F)[9]) {
  std::copy_n(motion_at<false>(u, nullptr, nodes, cell_size, place).F, 9, F);
}

Vec3 reference_place(const LatticeBody& body, const Block& block, int cell,
                     const float (&place)[3]) {
  const int z = cell / block.plane, y = cell % block.plane / block.pitch,
            x = cell % block.plane % block.pitch;
  return body.node_position(block.cell_x(x), block.y + y, block.z + z) +
         body.cell_size * Vec3(place[0], place[1], place[2]);
}

FacetMotion facet_motion(const LatticeBody& body, const Block& block, const Facet& facet,
                         const Nodes& nodes) {
  const PlaceMotion m =
      motion_at<true>(nodes.u, nodes.v, CellNodes(block, facet.cell), body.cell_size, facet.center);
  const Vec3 place = reference_place(body, block, facet.cell, facet.center);
  return facet_motion(facet, {place[0], place[1], place[2]}, m.u, m.v, m.F);
}

}  // namespace tissue_sim
