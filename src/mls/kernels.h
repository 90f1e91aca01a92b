// The two passes over pairs that a substep is made of, compiled for each instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compute/simd.h"

namespace tissue_sim {

/// Nodes whose stress is worked out at a time.
inline constexpr int kMlsChunk = 16;

/// Rows of MlsLanes: places, displacements, Q by rows of it, kappa, velocities.
inline constexpr int kMlsPlaceRow = 0, kMlsURow = 3, kMlsStressRow = 6, kMlsKappaRow = 15,
                     kMlsVRow = 16, kMlsRows = 19;

/// Slots of a chunk (MlsLanes): first .. both_end - 1 are for the first half of its lanes, both ..
/// end - 1 for the second.
struct MlsSlots {
  std::int32_t first = 0, both = 0, both_end = 0, end = 0;
};

/// What the passes read and write; arrays as in MlsState.
struct MlsField {
  int count;
  const float* place;
  const float* u;
  const float* v;
  float* rows;  ///< of MlsLanes, from the first node on
  std::size_t stride;
  const MlsSlots* slots;           ///< per chunk
  const std::int32_t* slot_first;  ///< per slot
  const float* slot_weight;        ///< per slot, kMlsChunk
  bool any_slots, any_entries;     ///< whether chunks go by slots, or by entries
  const std::int32_t* begin;
  const std::int32_t* other;
  const float* weight;
  const float* inverse_moment[6];
  const float *volume_mu, *volume_lambda, *volume_eta;
  const float* kappa;
  const std::uint8_t* neo_hookean;
  /// For those that go by entries: of each node 16 floats, Q by columns of four: Q_i = V_i P_i
  /// M_i^-1 - kappa_i H_i. The fourth of the first column is kappa_i.
  float* stress;
  bool viscous;
  /// Where tissue may touch tissue: which chunks have nodes that may, and of those the deformation
  /// gradients by components, kMlsChunk each.
  const std::uint8_t* touching = nullptr;
  float* deformation = nullptr;
};

/// What a chunk's nodes show.
struct MlsMeasure {
  double elastic = 0;  ///< energy of their strain and the penalty [J]
  float stretch2 = 0;  ///< the most that a node has: most_stretch2()
  bool finite = true;
};

struct MlsKernels {
  /// Displacements (and velocities, where tissue is viscous) of a chunk into the rows: of all
  /// chunks, before anything below.
  void (*spread)(const MlsField& field, int chunk);
  /// Q of a chunk's nodes, from the displacements of their neighbours.
  void (*stresses)(const MlsField& field, int chunk);
  /// Forces on a chunk's nodes into out[4 kMlsChunk], from Q of their neighbours [N].
  void (*forces)(const MlsField& field, int chunk, float* out);
  /// Energy and stiffening of a chunk's nodes; their von Mises stress [Pa] where `von_mises` is not
  /// null, how much each has stiffened where `stiffening` is not: kMlsChunk floats each.
  MlsMeasure (*measure)(const MlsField& field, int chunk, float* von_mises, float* stiffening);
};

const MlsKernels& mls_kernels(InstructionSet set);

}  // namespace tissue_sim
