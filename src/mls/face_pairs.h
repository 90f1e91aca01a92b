// Two nodes each of which faces may touch, laid out for vectors: on the CPU.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compute/array.h"
#include "compute/simd.h"

namespace tissue_sim {

/// Pairs that are worked on at a time, and nodes.
inline constexpr int kMlsFaceBlock = 16;

/// Floats of a node's record, what pairs read of it in one place: reference place and depth;
/// displacement; face in reference space and couples; normal and weights; deformation with
/// stiffness, damping and the root of friction; the inverse of the deformation.
inline constexpr int kMlsFaceRecord = 40, kMlsFaceU = 4, kMlsFaceOutward = 8, kMlsFaceNormal = 12,
                     kMlsFaceDeformation = 16, kMlsFaceSpring = 25, kMlsFaceInverse = 28;

/// Rows of what a pair remembers, as in MlsSlip.
inline constexpr int kMlsSlipLow = 0, kMlsSlipHigh = 3, kMlsSlipApart = 6, kMlsSlipGap = 9,
                     kMlsSlipBegun = 10, kMlsSlipRows = 11;
/// Floats of what a pair comes to: force on the low one, arms of both.
inline constexpr int kMlsFacePush = 12;

/// Those that touch come first, then those that feel one another, then those that are only near;
/// whole blocks of the last rest until they may feel one another.
struct MlsFacePairs {
  bool made = false;                          ///< from what was found last
  Array<std::int32_t> low, high;              ///< numbers among MlsNodeContacts::node
  Array<std::int32_t> low_entry, high_entry;  ///< in MlsNodeContacts::other
  Array<float> live;                          ///< 0 where it fills a block up, else 1
  Array<float> edge;                          ///< mean of both [m]
  Array<float> weight;                        ///< of the present substep
  Array<float> slip;                          ///< kMlsSlipRows rows
  Array<float> push;                          ///< kMlsFacePush each, where they touch
  Array<std::uint8_t> rests;                  ///< per block: substeps
  Array<float> record;                        ///< kMlsFaceRecord of each node
  Array<std::int32_t> begin;                  ///< per node, and one more: its pairs in ...
  Array<std::int32_t> of;  ///< ... this, twice the number, and 1 more where it is the high one

  int blocks() const { return static_cast<int>(low.size()) / kMlsFaceBlock; }
};

/// What the kernels work on.
struct MlsFaceField {
  const std::int32_t *node, *low, *high;
  const float *live, *edge;
  const float *u, *v;  ///< as in MlsState
  float* record;
  float* weight;
  float* slip;
  std::size_t stride;  ///< of its rows
  float* push;
  std::uint8_t* rests;
  float dt;     ///< the substep [s]
  float since;  ///< the last one [s]
};

struct MlsFaceKernels {
  /// Weights of a block of pairs that does not rest; whether there are any. Else it rests until
  /// there may be.
  bool (*weigh)(const MlsFaceField& field, int block);
  /// Deformation, normal and inverse of a block of nodes into their records, from deformation
  /// gradients by components; `knows`: which bear couples, which know their normal (1, else 0).
  void (*turn)(const float (&F)[9][kMlsFaceBlock], const float (&knows)[2][kMlsFaceBlock],
               float* record);
  /// What a block of pairs with any weights push, after the records of their nodes are known;
  /// whether any touch.
  bool (*push)(const MlsFaceField& field, int block);
};

const MlsFaceKernels& mls_face_kernels(InstructionSet set);

}  // namespace tissue_sim
