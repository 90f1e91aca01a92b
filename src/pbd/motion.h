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

/// Moves a vertex on; each of them has four floats (Vertices).
TISSUE_SIM_INLINE void predict(const StepNumbers& step, const float* x, float* moved,
                               float* predicted, float* v) {
  const bool held = x[3] == 0;
  for (int a = 0; a < 3; ++a) {
    // Drag takes nothing off the weight. What is held goes as its anchor does.
    if (!held) v[a] = step.decay * v[a] + step.h * step.gravity[a];
    moved[a] += step.h * v[a];
    predicted[a] = moved[a];
  }
}

/// The sum of two, rounded; `rest` becomes what that rounds off.
TISSUE_SIM_INLINE float sum_and_rest(float a, float b, float& rest) {
  const float sum = a + b, of_b = sum - a;
  rest = (a - (sum - of_b)) + (b - of_b);
  return sum;
}

/// v += (moved - predicted) / h: what no constraint moved keeps its velocity to the bit. What
/// vertices moved by is taken into where they are, and only the rest of it, that has no room there,
/// remains: steps move vertices by less than single precision has room for beside their places.
TISSUE_SIM_INLINE void take_velocity(const StepNumbers& step, float* x, float* moved,
                                     const float* predicted, float* v) {
  for (int a = 0; a < 3; ++a) {
    v[a] += step.inverse_h * (moved[a] - predicted[a]);
    x[a] = sum_and_rest(x[a], moved[a], moved[a]);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
