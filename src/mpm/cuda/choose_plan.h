// How a tissue is spread over a GPU: the shape of its blocks and the threads for them.
#pragma once

#include <cstddef>
#include <vector>

#include "mpm/blocks/blocks.h"
#include "mpm/cuda/substeps.h"
#include "mpm/lattice/lattice_body.h"

namespace tissue_sim {

/// What a block has, or what blocks that share a thread block have together, or may have.
struct BundleSize {
  int columns;      ///< that hold points
  int plane_slots;  ///< of one plane of nodes
  int slots;
};

/// A block and what it is of: only blocks of one kind share a thread block.
struct BlockToBundle {
  int kind;
  BundleSize size;
};

/// The bundles that the blocks' columns alone would fill.
std::size_t fewest_bundles(const std::vector<BlockToBundle>& blocks, const BundleSize& limits);

/// Bundles, up to `wanted` of them: large blocks first, each of the others with those that have the
/// fewest columns. Gives indices into `blocks`; more than `wanted` bundles where they do not fit
/// into fewer.
std::vector<std::vector<int>> bundle_blocks(const std::vector<BlockToBundle>& blocks,
                                            std::size_t wanted, const BundleSize& limits);

/// The same in as few rounds of `at_once` bundles as they fit into, but no more than `most`
/// bundles, else none.
std::vector<std::vector<int>> bundle_in_rounds(const std::vector<BlockToBundle>& blocks,
                                               std::size_t at_once, std::size_t most,
                                               const BundleSize& limits);

/// Blocks that hold points, and how many columns of cells that do all of them have.
struct BlockCount {
  double blocks = 0, columns = 0;
};

/// Counts the blocks of a body by their shape.
class BlockCounts {
 public:
  /// For shapes of up to max_y by max_z cells along y and z.
  BlockCounts(const LatticeBody& body, int max_y, int max_z);
  /// Of blocks of at most x by y by z cells, as make_blocks() makes them of a body without holes.
  BlockCount count(int x, int y, int z) const;
  /// These blocks one by one; `kind` is what they are of.
  void list(int x, int y, int z, int kind, std::vector<BlockToBundle>& blocks) const;
  bool fills_box() const { return fills_box_; }

 private:
  /// Cells from the first to the last that hold points.
  struct Extent {
    int begin = 1 << 30, end = 0;
    int length() const { return end > begin ? end - begin : 0; }
    void add(const Extent& other) {
      begin = begin < other.begin ? begin : other.begin;
      end = end > other.end ? end : other.end;
    }
  };
  /// Of the rows of cells [ny] from layer z0 on, `z` layers together.
  void find_layer(int z0, int z, std::vector<Extent>& layer) const;

  int nx_, ny_, nz_;
  bool fills_box_;
  std::vector<Extent> rows_;  // [nz][ny]; empty for a body that fills its box
  /// Of blocks of y by z cells: how long each is along x before it is divided.
  struct Rods {
    std::vector<int> length;
    double columns = 0;
  };
  std::vector<Rods> rods_;  // [y][z], from 1 on; empty for a body that fills its box
  int max_y_, max_z_;
};

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
