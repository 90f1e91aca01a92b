// Pieces: the connected components of a graph of links between points, and which piece is which
// over time.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fragments/parted_run.h"
#include "math/union_find.h"
#include "tissue_sim/fragments.h"

namespace tissue_sim {

/// Which piece each point belongs to, over time.
struct Pieces {
  std::vector<std::int32_t> of_point;  ///< Fragment::id
  std::vector<Fragment> all;           ///< by id; measure_pieces() says where they are
  std::vector<std::int32_t> lowest;    ///< by id: the piece's lowest point
  std::vector<std::int32_t> anchored;  ///< all points that are
  int next_id = 0;
};

/// What pieces are made of.
struct PiecePoints {
  std::int32_t count = 0;
  std::function<int(std::int32_t point)> body;  ///< index into Scene::bodies
  const float* volume = nullptr;                ///< of each point [m^3]
  const std::uint8_t* anchored = nullptr;       ///< of each point: not 0 where it is held
};

/// One piece for each body, whose id is the body's index. A body may have parts that do not hold
/// together: update_pieces() tells.
Pieces one_piece_a_body(int bodies, const PiecePoints& points);

/// Gives the parts of pieces their ids, of which `parted` are, in order, all runs that do not hold
/// together with their piece's lowest point any more; `volume` is of each point [m^3]. Returns the
/// new ids.
std::vector<int> part_pieces(const float* volume, const std::vector<PartedRun>& parted,
                             Pieces& pieces);

/// Labels the points anew after links broke: `linked` has joined those that are left. Returns the
/// new ids.
std::vector<int> update_pieces(const float* volume, UnionFind& linked, Pieces& pieces);

}  // namespace tissue_sim
