// Blocks of all bodies, and how their forces come together at the nodes in a fixed order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "compute/host_device.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/surface/block.h"

namespace tissue_sim {

/// A box of cells of one body. Where a cut goes through it, it is worked on as several blocks, so
/// that in each of them every node means one field only and the uncut kernel serves.
struct BlockRegion {
  int body;
  int x, y, z, nx, ny, nz;  ///< cells
  std::vector<Block> blocks;
  bool half = false;  ///< of one that a cut goes through: see BlockShape::room
  TISSUE_SIM_FIELDS(body, x, y, z, nx, ny, nz, blocks, half)
};

/// Forces on up to kNodeRow nodes that follow one another, a vector: the sum of parts of the force
/// buffer, in this order.
struct NodeRow {
  int first_node, count;
  int first_part, part_count;
};
inline constexpr int kNodeRow = kLanes;  ///< from a multiple of it on
struct RowPart {
  std::size_t force;      ///< offset of component x in the force buffer
  std::size_t component;  ///< offset to the next component
  int begin, count;       ///< nodes of the row
};

struct Blocks {
  std::vector<BlockRegion> regions;
  std::vector<Block*> all;                ///< in a fixed order
  bool uniform = false, has_rows = true;  ///< see BlockShape
  int room = 0;                           ///< the same; 0 once there were too many
  /// Of each, the blocks before the last update_blocks() that had its points.
  struct Origin {
    int begin, end;
  };
  std::vector<Origin> origin;
  std::size_t force_size = 0;
  int next_number = 0;  ///< Block::number
  /// Per lattice node, of its cell: bonds broke near it since its region's blocks were made. Empty
  /// before any did.
  std::vector<std::uint8_t> stale_facets;

  std::vector<int> by_cost;  ///< `all`, the largest first, so that threads end together
  std::vector<NodeRow> rows;
  std::vector<RowPart> row_parts;

  bool has_halves() const {
    return std::any_of(regions.begin(), regions.end(), [](const BlockRegion& r) { return r.half; });
  }
};

/// How large regions are, in cells; the default is the CPU's.
struct BlockShape {
  int x = 48;  ///< at most
  int y = 8, z = 4;
  bool uniform = false;  ///< a block for each side of a cut and each material: the GPU's kernels
                         ///< know one of both
  bool has_rows = true;  ///< and parts: the GPU has its own tables of how forces come together
  /// Regions that a cut goes through are halved along z as long as there are not more blocks than
  /// this: where each has a multiprocessor, all others wait for those that are cut.
  int room = 0;
};

/// Lists all blocks of the regions, with room for their forces.
void list_blocks(Blocks& blocks);
/// Works out how their forces come together at so many nodes.
void connect_forces(Blocks& blocks, std::size_t node_count);

/// Cuts the bodies' lattices into regions and makes their blocks.
Blocks make_blocks(const LatticeTissue& tissue, const BlockShape& shape, Cpu& cpu);

/// Makes the blocks anew of the regions that one of the `cells` touches, after their nodes' fields
/// changed.
void update_blocks(Blocks& blocks, const LatticeTissue& tissue,
                   const std::vector<NodeFields::Cell>& cells, Cpu& cpu);

inline constexpr int kRunGap = 2;  ///< cells: a new run costs about as much as so many

/// Makes the region's blocks, without facets: one for the sides of cuts that reach from the same
/// z-plane to the same, or with `uniform` one for each side and material.
void fill_region(BlockRegion& r, const LatticeTissue& tissue, bool uniform);

}  // namespace tissue_sim
