// Which blocks share a thread block.
#pragma once

#include <cstddef>
#include <vector>

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

}  // namespace tissue_sim
