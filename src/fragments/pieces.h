// Pieces: the connected components of the bonds, and which piece is which over time.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/parted_run.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/split/node_box.h"
#include "tissue_sim/fragments.h"

namespace tissue_sim {

/// Which piece each point belongs to, over time.
struct Pieces {
  std::vector<std::int32_t> of_point;  ///< Fragment::id
  std::vector<Fragment> all;           ///< by id; mpm/piece_motion.h says where they are
  std::vector<std::int32_t> lowest;    ///< by id: the piece's lowest point
  std::vector<std::int32_t> anchored;  ///< all points that are
  int next_id = 0;
};

/// One piece for each body.
Pieces whole_pieces(const std::vector<LatticeBody>& bodies, const Points& points);

/// Whether pieces may have come apart as the points `changed` lost bonds: false if near each of
/// them other bonds still hold it together with the neighbours that it lost.
bool may_have_parted(const std::vector<LatticeBody>& bodies, const Points& points,
                     const BondWindows& bonds, const std::vector<std::int32_t>& changed);

/// Gives the parts of pieces their ids, of which `parted` are, in order, all runs that do not hold
/// together with their piece's lowest point any more. Returns the new ids.
std::vector<int> part_pieces(const Points& points, const std::vector<PartedRun>& parted,
                             Pieces& pieces);

/// Labels the points anew after bonds broke (union-find over runs of points along x). Returns the
/// new ids.
std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               Pieces& pieces);

}  // namespace tissue_sim
