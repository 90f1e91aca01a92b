// The two steps of update_pieces().
#pragma once

#include <vector>

#include "fragments/pieces.h"

namespace tissue_sim {

/// All runs of points that do not hold together with their piece's lowest point any more, in order,
/// for part_pieces(): where `linked` has joined what links are left. Changes no piece.
std::vector<PartedRun> find_parted(const Pieces& pieces, UnionFind& linked);

}  // namespace tissue_sim
