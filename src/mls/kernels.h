// The two passes over pairs that a substep is made of, compiled for each instruction set.
#pragma once

#include <cstdint>

#include "compute/simd.h"

namespace tissue_sim {

/// Nodes whose stress is worked out at a time.
inline constexpr int kMlsChunk = 16;

/// What the passes read and write; arrays as in MlsState.
struct MlsField {
  int count;
  const float* place;
  const float* u;
  const float* v;
  const std::int32_t* begin;
  const std::int32_t* other;
  const float* weight;
  const float* inverse_moment[6];
  const float *volume_mu, *volume_lambda, *volume_eta;
  const float* kappa;
  const std::uint8_t* neo_hookean;
  /// Of each node 16 floats, Q by columns of four: Q_i = V_i P_i M_i^-1 - kappa_i H_i. The fourth
  /// of the first column is kappa_i.
  float* stress;
  bool viscous;
};

/// What a chunk's nodes show.
struct MlsMeasure {
  double elastic = 0;    ///< energy of their strain [J]
  float stiffening = 1;  ///< the most that a node has: largest column of cof F, squared
  bool finite = true;
};

struct MlsKernels {
  /// Q of a chunk's nodes, from the displacements of their neighbours.
  void (*stresses)(const MlsField& field, int chunk);
  /// Force on a node into out[4], from Q of its neighbours [N].
  void (*force)(const MlsField& field, int node, float* out);
  /// Energy and stiffening of a chunk's nodes; their von Mises stress [Pa] where `von_mises` is not
  /// null, how much each has stiffened where `stiffening` is not: kMlsChunk floats each.
  MlsMeasure (*measure)(const MlsField& field, int chunk, float* von_mises, float* stiffening);
};

const MlsKernels& mls_kernels(InstructionSet set);

}  // namespace tissue_sim
