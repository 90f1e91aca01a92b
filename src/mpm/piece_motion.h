// Where the pieces are and how they move.
#pragma once

#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// Fills centroid (of the mass), velocity and box of all pieces.
void measure_pieces(MpmState& state, Pieces& pieces);

}  // namespace tissue_sim
