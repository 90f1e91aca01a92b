// The fragment network: one hidden layer, as in Sung, Kim and Shin, Electronics 13:1340, 2024,
// section 2.1, as functions for host and device. Tanh is on the hidden layer only: on the outputs,
// as printed, it would bound probabilities to 0.12 .. 0.88.
#pragma once

#include <cmath>

#include "compute/host_device.h"
#include "fragments/features.h"

namespace tissue_sim {

inline constexpr int kHiddenCount = kPartingFeatureCount * 3 / 2;
/// Of not parting, of parting: their softmax is the probability.
inline constexpr int kOutputs = 2;

/// Its weights, as functions read them: of a layer's inputs, one after the other, those to all
/// outputs side by side.
struct NetworkWeights {
  const float* hidden_weights;  ///< [kPartingFeatureCount][kHiddenCount]
  const float* hidden_biases;   ///< [kHiddenCount]
  const float* output_weights;  ///< [kHiddenCount][kOutputs]
  const float* output_biases;   ///< [kOutputs]
};

/// tanh x within 3e-7, with the same bits wherever it is worked out without fused operations: the
/// rational function that Eigen and others use.
TISSUE_SIM_INLINE float hidden_tanh(float x) {
  x = x > 7.90531f ? 7.90531f : (x < -7.90531f ? -7.90531f : x);
  const float y = x * x;
  float p = -2.76076847742355e-16f;
  p = p * y + 2.00018790482477e-13f;
  p = p * y - 8.60467152213735e-11f;
  p = p * y + 5.12229709037114e-08f;
  p = p * y + 1.48572235717979e-05f;
  p = p * y + 6.37261928875436e-04f;
  p = p * y + 4.89352455891786e-03f;
  float q = 1.19825839466702e-06f;
  q = q * y + 1.18534705686654e-04f;
  q = q * y + 2.26843463243900e-03f;
  q = q * y + 4.89352518554385e-03f;
  return x * p / q;
}

/// What the network says of features x[kPartingFeatureCount].
TISSUE_SIM_INLINE void run_network(const NetworkWeights& w, const float* x,
                                   float (&out)[kOutputs]) {
  float hidden[kHiddenCount];
  for (int h = 0; h < kHiddenCount; ++h) hidden[h] = w.hidden_biases[h];
  for (int i = 0; i < kPartingFeatureCount; ++i) {
    const float* weights = w.hidden_weights + i * kHiddenCount;
    for (int h = 0; h < kHiddenCount; ++h) hidden[h] += x[i] * weights[h];
  }
  for (int h = 0; h < kHiddenCount; ++h) hidden[h] = hidden_tanh(hidden[h]);
  for (int o = 0; o < kOutputs; ++o) out[o] = w.output_biases[o];
  for (int h = 0; h < kHiddenCount; ++h) {
    const float* weights = w.output_weights + h * kOutputs;
    for (int o = 0; o < kOutputs; ++o) out[o] += hidden[h] * weights[o];
  }
}

/// Probability that the cell of these features parts within the horizon.
TISSUE_SIM_INLINE float parting_probability(const NetworkWeights& network, const float* x) {
  float out[kOutputs];
  run_network(network, x, out);
  return 1 / (1 + std::exp(out[0] - out[1]));
}

}  // namespace tissue_sim
