// How a tissue is spread over a GPU: the shape of its blocks and the threads for them.
#pragma once

#include <vector>

#include "mpm/blocks.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {

struct CudaShape {
  BlockShape blocks;
  int threads = 64;      ///< see CudaPlan
  bool small = true;     ///< the same
  bool marches = false;  ///< the same
  /// CudaPlan::pairs, and the columns that a thread block can have.
  bool pairs() const { return 2 * blocks.x * blocks.y <= threads; }
  int columns() const { return pairs() ? threads / 2 : threads; }
};

/// What the choice needs to know of a GPU.
struct CudaLimits {
  int processors;            ///< multiprocessors
  std::size_t shared_bytes;  ///< shared memory that a thread block can have
};

/// The shape for these bodies that a model of the substep's time finds fastest; one that marches
/// only if they `may_march`: see can_march(). The environment variable TISSUE_SIM_CUDA_SHAPE="x y z
/// threads way", way 0 for large, 1 for small, 2 for a shape that marches, overrules it, for
/// measurements.
CudaShape choose_shape(const std::vector<LatticeBody>& bodies, const CudaLimits& limits,
                       bool may_march);

/// Whether these are one body that fills a box, of one material that neither damps nor tears.
bool can_march(const std::vector<LatticeBody>& bodies);

/// What the blocks that share a thread block may have together.
struct BundleLimits {
  int columns;      ///< that hold points
  int plane_slots;  ///< of one plane of nodes
  int slots;
};

/// Each block alone: indices into Blocks::all. Where more than run at once, the smallest come last,
/// and to the thread blocks that have the smallest of the others.
std::vector<std::vector<int>> single_blocks(const std::vector<Block*>& blocks, std::size_t at_once,
                                            Cpu& cpu);

/// Bundles, up to `wanted` of them: large blocks first, each of the others with those that have the
/// fewest columns. Gives indices into `blocks`; more than `wanted` bundles where they do not fit
/// into fewer.
std::vector<std::vector<int>> bundle_blocks(const std::vector<Block*>& blocks, std::size_t wanted,
                                            const BundleLimits& limits, Cpu& cpu);

}  // namespace tissue_sim
