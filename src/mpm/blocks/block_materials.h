// Which materials the points of a block are of.
#pragma once

#include "mpm/blocks/block.h"
#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// Sets Block::material and, where there are several, Block::mixture, from the block's points.
void find_materials(Block& block, const LatticeBody& body, const Points& points);

}  // namespace tissue_sim
