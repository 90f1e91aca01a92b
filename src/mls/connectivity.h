// What of the pairs tells which nodes hang together.
#pragma once

#include <cstdint>

#include "compute/array.h"
#include "math/union_find.h"
#include "mls/nodes.h"
#include "mls/pairs.h"

namespace tissue_sim {

struct MlsState;

/// A sparse part of the pairs, about six of a node's 17: of each pair that is not in it both nodes
/// have pairs with a third one that are (a 2-spanner). So wherever nothing is cut it joins what all
/// pairs would. And clusters of some 64 nodes that hang together while none of them is beside a
/// cut.
struct MlsConnectivity {
  Array<std::int32_t> begin;                         ///< per node, and one more
  Array<std::int32_t> other;                         ///< the neighbour
  Array<std::int32_t> cluster;                       ///< of each node
  Array<std::int32_t> members_begin, members;        ///< nodes of each cluster, by number
  Array<std::int32_t> neighbours_begin, neighbours;  ///< later clusters with pairs to each
};

/// The shortest pairs that do (Althoefer, Das, Dobkin, Joseph, Soares 1993: greedily).
MlsConnectivity make_connectivity(const MlsNodes& nodes, const MlsPairs& pairs);

/// Joins nodes with an uncrossed pair: clusters as a whole where nothing is cut, else pairs of the
/// connectivity, and all of nodes beside a cut.
UnionFind join_uncrossed(const MlsState& state);

}  // namespace tissue_sim
