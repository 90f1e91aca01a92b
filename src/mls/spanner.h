// What of the pairs tells which nodes hang together.
#pragma once

#include <cstdint>

#include "compute/array.h"
#include "math/union_find.h"
#include "mls/nodes.h"
#include "mls/pairs.h"

namespace tissue_sim {

struct MlsState;

/// A sparse part of the pairs, about three a node of nine: of each pair that is not in it both
/// nodes have pairs with a third one that are (a 2-spanner). So wherever nothing is cut it joins
/// what all pairs would.
struct MlsSpanner {
  Array<std::int32_t> begin;  ///< per node, and one more
  Array<std::int32_t> entry;  ///< of MlsPairs, those with later nodes
};

/// The shortest pairs that do (Althoefer, Das, Dobkin, Joseph, Soares 1993: greedily).
MlsSpanner make_spanner(const MlsNodes& nodes, const MlsPairs& pairs);

/// Joins nodes with an uncrossed pair: pairs of the spanner, and all of nodes beside a cut.
UnionFind join_uncrossed(const MlsState& state);

}  // namespace tissue_sim
