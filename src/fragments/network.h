// The fragment network: two networks of one hidden layer each (Sung, Kim and Shin, Electronics
// 13:1340, 2024, section 2.1), as functions for host and device. Tanh is on the hidden layer only:
// on the outputs, as printed, it would bound probabilities to 0.12 .. 0.88 and leave variances
// below zero.
#pragma once

#include <cmath>

#include "compute/host_device.h"
#include "fragments/features.h"

namespace tissue_sim {

inline constexpr int hidden_count(int inputs) { return inputs * 3 / 2; }
inline constexpr int kHiddenCount = hidden_count(kFeatureCount);
inline constexpr int kMostHidden = hidden_count(kAllFeatureCount);
/// Of the classifier: of not being part of a fragment, of being part of one. Their softmax is the
/// probability.
inline constexpr int kClassifierOutputs = 2;
/// Of the modifier: mean of the change of F, row by row, and the ln of its variance.
inline constexpr int kModifierOutputs = 18;

/// Weights of one network, as functions read them: of a layer's inputs, one after the other, those
/// to all outputs side by side.
struct NetworkWeights {
  int inputs;  ///< kFeatureCount, or kAllFeatureCount; there are 1.5 times as many hidden
  int first;   ///< of them that has a weight at all
  const float* hidden_weights;  ///< [inputs][hidden]
  const float* hidden_biases;   ///< [hidden]
  const float* output_weights;  ///< [hidden][outputs]
  const float* output_biases;   ///< [outputs]
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

/// What a network says of features x[inputs].
template <int kOutputs>
TISSUE_SIM_INLINE void run_network(const NetworkWeights& w, const float* x,
                                   float (&out)[kOutputs]) {
  const int count = hidden_count(w.inputs);
  float hidden[kMostHidden];
  for (int h = 0; h < count; ++h) hidden[h] = w.hidden_biases[h];
  for (int i = w.first; i < w.inputs; ++i) {
    const float* weights = w.hidden_weights + i * count;
    for (int h = 0; h < count; ++h) hidden[h] += x[i] * weights[h];
  }
  for (int h = 0; h < count; ++h) hidden[h] = hidden_tanh(hidden[h]);
  for (int o = 0; o < kOutputs; ++o) out[o] = w.output_biases[o];
  for (int h = 0; h < count; ++h) {
    const float* weights = w.output_weights + h * kOutputs;
    for (int o = 0; o < kOutputs; ++o) out[o] += hidden[h] * weights[o];
  }
}

/// Probability that the point of these features is part of a fragment within the horizon.
TISSUE_SIM_INLINE float fragment_probability(const NetworkWeights& classifier, const float* x) {
  float out[kClassifierOutputs];
  run_network(classifier, x, out);
  return 1 / (1 + std::exp(out[0] - out[1]));
}

}  // namespace tissue_sim
