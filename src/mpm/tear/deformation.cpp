#include "mpm/tear/deformation.h"

#include <Eigen/Dense>
#include <cmath>

#include "math/bspline.h"

namespace tissue_sim {

Eigen::Matrix3d deformation_gradient(const LatticeBody& body, const Points::Site& point,
                                     const NodeFields& fields, const Nodes& nodes) {
  const int at[3] = {point.x % 2, point.y % 2, point.z % 2};
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  for (int k = 0; k < 27; ++k) {
    const int d[3] = {k % 3, k / 3 % 3, k / 9}, node = fields.node(body, point, k);
    const Vec3 u(nodes.u[0][node], nodes.u[1][node], nodes.u[2][node]);
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      F.col(a) += lattice_slope(at[a], d[a]) * lattice_weight(at[b], d[b]) *
                  lattice_weight(at[c], d[c]) / body.cell_size * u;
    }
  }
  return F;
}

Deformation::Deformation(const LatticeBody& body, const Points::Site& point,
                         const NodeFields& fields, const Nodes& nodes) {
  const Eigen::Matrix3d F = deformation_gradient(body, point, fields, nodes);
  if (!F.allFinite()) return;
  const Eigen::Vector3d s = F.jacobiSvd().singularValues();
  stretch = s[0];
  stiffening = s[0] * s[0] * s[1] * s[1] + std::fabs(F.determinant() - 1) * F.norm() / std::sqrt(3);
}

}  // namespace tissue_sim
