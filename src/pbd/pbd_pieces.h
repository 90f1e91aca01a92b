// Pieces of meshes: what hangs together by triangles, tetrahedra and internal constraints.
#pragma once

#include <vector>

#include "fragments/pieces.h"
#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// What hangs together.
UnionFind joined(const State& s);

/// What hangs together by triangles alone.
UnionFind skins(const State& s);

/// One piece a body, and more for a mesh in parts.
Pieces whole_pieces(const State& s);

/// Labels vertices anew after a cut, which may have added some: `origin` is of each vertex from the
/// first new one on that from which it came. Returns the new ids.
std::vector<int> update_pieces(const State& s, const std::vector<std::int32_t>& origin,
                               Pieces& pieces);

/// Where they are and how they move, by mass.
void measure_pieces(const State& s, Pieces& pieces);

/// Volume of each piece, by Fragment::id: of its tetrahedra; of the surface model what its
/// triangles enclose where they are closed, and the columns below its vertices where they are not
/// [m^3].
std::vector<double> piece_volumes(const State& s, const Pieces& pieces);

}  // namespace pbd
}  // namespace tissue_sim
