// How a vertex moves over a step, constraints apart: on the CPU and on the GPU.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {
namespace pbd {

/// What a step is taken with.
struct StepNumbers {
  float h, inverse_h, inverse_h2;  ///< [s], [1/s], [1/s^2]
  float decay;                     ///< of velocities by drag, over the step
  float gravity[3];                ///< [m/s^2]
};

/// Moves a vertex on; x, predicted and v have four floats.
TISSUE_SIM_INLINE void predict(const StepNumbers& step, float* x, float* predicted, float* v) {
  const bool held = x[3] == 0;
  for (int a = 0; a < 3; ++a) {
    // Drag takes nothing off the weight.
    v[a] = held ? 0 : step.decay * v[a] + step.h * step.gravity[a];
    x[a] += step.h * v[a];
    predicted[a] = x[a];
  }
}

/// v += (x - predicted) / h: what no constraint moved keeps its velocity to the bit, which
/// differences of positions would round.
TISSUE_SIM_INLINE void take_velocity(const StepNumbers& step, const float* x,
                                     const float* predicted, float* v) {
  for (int a = 0; a < 3; ++a) v[a] += step.inverse_h * (x[a] - predicted[a]);
}

}  // namespace pbd
}  // namespace tissue_sim
