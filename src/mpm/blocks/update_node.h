// What the kernels of CPU and GPU have in common: the step of one node, and what they find.
#pragma once

#include <cstdint>

#include "compute/host_device.h"
#include "frame/leapfrog.h"

namespace tissue_sim {

/// Leapfrog: v += kick (f / m + g), then u += dt v; anchored and empty nodes (inv_mass 0) stay.
struct NodeStep {
  float dt;          ///< [s]
  float kick;        ///< see kick_of() [s]
  float keep;        ///< share of the velocity that drag leaves in a substep
  float gravity[3];  ///< [m/s^2]

  /// Moves the component `c` on: u [m], v [m/s], under the force f [N]; one node or a vector of
  /// them.
  template <class T>
  TISSUE_SIM_INLINE void move(int c, T f, T mass, T inv_mass, T& u, T& v) const {
    const T kick_over_m = kick * inv_mass;
    const T velocity = keep * v + kick_over_m * (f + mass * gravity[c]);
    v = velocity;
    u += dt * velocity;
  }
};

/// The same for node `i` of arrays.
struct UpdateNode : NodeStep {
  float* u[3];
  float* v[3];
  const float* mass;
  const float* inv_mass;

  TISSUE_SIM_INLINE void operator()(int i, float fx, float fy, float fz) const {
    const float f[3] = {fx, fy, fz};
    for (int c = 0; c < 3; ++c) move(c, f[c], mass[i], inv_mass[i], u[c][i], v[c][i]);
  }
};

/// A point that is stretched far, and C = F^T F there: 00 11 22 01 02 12.
struct StretchedPoint {
  std::int32_t point;
  float C[6];
};

}  // namespace tissue_sim
