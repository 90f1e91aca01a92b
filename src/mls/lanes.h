// Pairs of sixteen nodes at a time, where their neighbours stand in a row as they do.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/array.h"
#include "mls/kernels.h"
#include "mls/pairs.h"

namespace tissue_sim {

/// In a lattice the k-th neighbours of nodes that follow one another follow one another, too. A
/// slot is such a row: neighbour first + l of lane l, with the pair's weight, 0 where they are
/// none. What passes read is then read sixteen nodes at a time, without gathering. A chunk whose
/// nodes have little in common (graded ones) has no slots and goes by its entries.
struct MlsLanes {
  std::vector<MlsSlots> of_chunk;
  std::vector<std::int32_t> first;  ///< per slot: neighbour of lane 0; may be outside of the nodes
  Array<float> weight;              ///< per slot, kMlsChunk of them
  std::vector<std::int32_t> at;     ///< per entry of MlsPairs: where its weight is; -1: by entries
  bool any_slots = false, any_entries = false;

  /// What neighbours are read from: kMlsRows rows of a float for each node, in one piece of memory,
  /// with room before and behind. Rows begin 256 bytes apart in a page, so that places at one index
  /// do not drive one another out of the cache.
  Array<float> rows;
  std::size_t stride = 0;
  float* row(int which) { return rows.data() + kMlsChunk + which * stride; }
};

/// Sorts pairs into slots. `place` is [4 nodes].
MlsLanes make_lanes(const MlsPairs& pairs, const Array<float>& place);

/// Takes the weight of an entry over, after it changed.
inline void put_weight(const MlsPairs& pairs, std::int32_t entry, MlsLanes& lanes) {
  if (lanes.at[entry] >= 0) lanes.weight[lanes.at[entry]] = pairs.weight[entry];
}
/// Those of all entries.
void put_weights(const MlsPairs& pairs, MlsLanes& lanes);

}  // namespace tissue_sim
