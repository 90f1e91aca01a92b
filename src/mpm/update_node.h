// The step of one node: the kernel that the CPU's rows and the GPU's for_each share.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {

/// Symplectic Euler: v += dt (f / m + g), then u += dt v; anchored and empty nodes (inv_mass 0) stay.
struct UpdateNode {
  float* u[3];
  float* v[3];
  const float* mass;
  const float* inv_mass;
  float dt;          ///< [s]
  float keep;        ///< share of the velocity that drag leaves in a substep
  float gravity[3];  ///< [m/s^2]

  TISSUE_SIM_INLINE void operator()(int i, float fx, float fy, float fz) const {
    const float f[3] = {fx, fy, fz};
    const float dt_over_m = dt * inv_mass[i];
    for (int c = 0; c < 3; ++c) {
      const float velocity = keep * v[c][i] + dt_over_m * (f[c] + mass[i] * gravity[c]);
      v[c][i] = velocity;
      u[c][i] += dt * velocity;
    }
  }
};

}  // namespace tissue_sim
