// Tissue that moves, and the blocks that it is worked on in.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <vector>

#include "compute/host_device.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/blocks/block_kernels.h"
#include "mpm/blocks/blocks.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

/// Within which box a block's points are, and how fast they move at most.
struct BlockMotion {
  Box box;           ///< [m]
  double speed = 0;  ///< [m/s]
  TISSUE_SIM_FIELDS(box, speed)
};

struct BlockTissue : LatticeTissue {
  double time = 0;  ///< since the beginning [s]
  float dt = 0;     ///< the last substep, 0 before the first [s]
  AnchorFaces anchors;
  Blocks blocks;
  std::vector<BlockMotion> motion;  ///< per block; exact as of measure_motion()

  const BlockKernels* kernels = nullptr;
  InstructionSet instructions = InstructionSet::kSse2;
  tbb::enumerable_thread_specific<BlockScratch> scratch;
};

BlockField block_field(const LatticeTissue& tissue, const Block& block);

/// Fills `motion`. Points, not nodes: a node at the rim of its body, or of a cut, that few points
/// see may swing far without moving any of them.
void measure_motion(BlockTissue& tissue);

// The front of cuts.

/// Lists the cells anew that see parted nodes.
void list_front_cells(BlockTissue& tissue);
/// Works on the i-th cell.
void work_on_front_cell(BlockTissue& tissue, int i);
/// Energy of the front beside what blocks have [J].
double front_elastic_energy(const BlockTissue& tissue);

}  // namespace tissue_sim
