// How a tissue is spread over a GPU: the shape of its blocks and the threads for them.
#pragma once

#include <vector>

#include "mpm/blocks/blocks.h"
#include "mpm/cuda/bundle_blocks.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {

struct CudaShape {
  BlockShape blocks;
  int threads = 64;   ///< see CudaPlan
  bool small = true;  ///< the same
  /// CudaPlan::pairs, and the columns that a thread block can have.
  bool pairs() const { return 2 * blocks.x * blocks.y <= threads; }
  int columns() const { return pairs() ? threads / 2 : threads; }
  bool operator==(const CudaShape& s) const {
    return blocks.x == s.blocks.x && blocks.y == s.blocks.y && blocks.z == s.blocks.z &&
           threads == s.threads && small == s.small;
  }
};

/// What the choice needs to know of a GPU.
struct CudaLimits {
  int processors;            ///< multiprocessors
  std::size_t shared_bytes;  ///< shared memory that a thread block can have
};

/// The shape for these bodies that a model of the substep's time finds fastest: as long as they
/// are `whole`, or when they are cut: cuts need room for the blocks that they add. The environment
/// variable TISSUE_SIM_CUDA_SHAPE="x y z threads way", way 0 for large, 1 for small, overrules it,
/// for measurements.
CudaShape choose_shape(const std::vector<LatticeBody>& bodies, const CudaLimits& limits,
                       bool whole);

/// Each block alone: indices into Blocks::all. Where more than run at once, the smallest come last,
/// and to the thread blocks that have the smallest of the others.
std::vector<std::vector<int>> single_blocks(const std::vector<Block*>& blocks, std::size_t at_once,
                                            Cpu& cpu);

/// The blocks as bundle_blocks() takes them.
std::vector<BlockToBundle> blocks_to_bundle(const std::vector<Block*>& blocks);

/// Two halves of a block that was cut have a rim more.
inline int most_plane_slots(int of_block) { return 3 * of_block / 2; }

}  // namespace tissue_sim
