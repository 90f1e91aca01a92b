// Which blocks share a thread block.
#pragma once

#include <cstddef>
#include <vector>

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

}  // namespace tissue_sim
