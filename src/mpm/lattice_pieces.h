// Pieces of lattice bodies: the components of the bonds.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

/// Points begin .. end - 1: neighbours along x that hold together. They stand and fall together.
struct PointRun {
  std::int32_t begin, end;
};

/// All points by `bonds` of each, in order.
std::vector<PointRun> runs_along_x(const std::uint8_t* bonds, std::int32_t count);

/// The first run of each run's component, by the same bonds. Where two runs lie side by side the
/// first bond between them tells.
UnionFind linked_runs(const LatticeTissue& tissue, const std::uint8_t* bonds,
                      const std::vector<PointRun>& runs);

/// One piece for each body, and for each part of it that holds together by itself.
Pieces whole_pieces(const LatticeTissue& tissue);

/// Whether pieces may have come apart as the points `changed` lost bonds: false if near each of
/// them other bonds still hold it together with the neighbours that it lost.
bool may_have_parted(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed);

/// Labels the points anew after bonds broke (over runs of points along x). Returns the new ids.
std::vector<int> update_pieces(const LatticeTissue& tissue, Pieces& pieces);

}  // namespace tissue_sim
