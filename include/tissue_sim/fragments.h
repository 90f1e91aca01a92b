// Pieces of tissue: the connected components of the bonds.
#pragma once

#include "tissue_sim/types.h"

namespace tissue_sim {

/// A connected piece. Bodies start as one piece each, with the body's index as id. When a piece
/// comes apart, its largest part keeps the id (of equals, the one with the lowest point id) and the
/// others get ids never used before.
struct Fragment {
  int id = 0;
  int parent = -1;     ///< the piece it came from, -1 for a body
  int body = 0;        ///< index into Scene::bodies
  bool loose = false;  ///< no anchored point, and came off a body (or the body is anchored)
  int point_count = 0;
  double volume = 0;             ///< in the reference configuration [m^3]
  Vec3 centroid = Vec3::Zero();  ///< [m]
  Vec3 velocity = Vec3::Zero();  ///< of the centre of mass [m/s]
  Box box;                       ///< of the points [m]
};

}  // namespace tissue_sim
