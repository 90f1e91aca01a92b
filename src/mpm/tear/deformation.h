// How much single points are deformed: a few that are looked at one by one.
#pragma once

#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/split/node_fields.h"

namespace tissue_sim {

/// A bit of debris that is deformed so that it has stiffened so much is wild.
inline constexpr double kWildStiffening = 5;

/// Deformation gradient at a point.
Eigen::Matrix3d deformation_gradient(const LatticeBody& body, const Points::Site& point,
                                     const NodeFields& fields, const Nodes& nodes);

struct Deformation {
  double stretch = 1;     ///< the largest
  double stiffening = 1;  ///< at least that of BlockState; both 1 where they are not finite
  Deformation(const LatticeBody& body, const Points::Site& point, const NodeFields& fields,
              const Nodes& nodes);
};

}  // namespace tissue_sim
