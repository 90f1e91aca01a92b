// Where an anchor of the meshless method is, for both devices.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {

/// Where an anchor has what it holds: at u = A X + b.
struct MlsAnchorPose {
  float turn[9];   ///< A by rows: rotation less the identity
  float shift[3];  ///< b [m]

  TISSUE_SIM_INLINE void displacement(const float* X, float* u) const {
    for (int a = 0; a < 3; ++a) {
      u[a] = turn[3 * a] * X[0] + turn[3 * a + 1] * X[1] + turn[3 * a + 2] * X[2] + shift[a];
    }
  }
};

}  // namespace tissue_sim
