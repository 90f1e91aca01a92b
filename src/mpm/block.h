// Block: a box of lattice cells that is worked on as a whole, with its points' volumes.
//
// Cells of one z-plane are numbered flat, cell (x, y) at y * pitch + x with pitch = nx + 2, so that
// SIMD lanes run along x across the row ends, a neighbour along y is `pitch` away, and the node
// that is dx, dy (0..2) from a cell's lowest is at the cell's number + dy * pitch + dx. The two
// lanes between rows hold no points: their volume is zero.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/array.h"
#include "contact/facets.h"
#include "tissue_sim/material.h"

namespace tissue_sim {

inline constexpr int kLanes = 16;  ///< rows are padded for the widest instruction set

struct Block {
  int body = 0;
  int x = 0, y = 0, z = 0;     ///< first cell, in cells of the body's lattice
  int nx = 0, ny = 0, nz = 0;  ///< cells

  int pitch = 0;   ///< nx + 2
  int stride = 0;  ///< lanes of one z-plane of cells, a multiple of kLanes
  int plane = 0;   ///< nodes of one z-plane, (ny + 2) * pitch and some to fill the last lanes

  Array<float> volume;        ///< [nz][8][stride], 0 where there is no point [m^3]
  Array<std::int32_t> point;  ///< [nz][8][stride], the point's number or -1

  /// [nz][stride]: volume of a cell's points where they are fewer than eight, else 0 [m^3]. Empty
  /// if every cell of the block is full. See mpm/stabilisation.h.
  Array<float> partial;

  /// Nodes of the block that are not the lattice's own, for the tissue is cut there: the field that
  /// this block's points see instead.
  struct SplitNode {
    int local;  ///< in the block's nodes: z * plane + y * pitch + x
    int node;   ///< in Nodes
  };
  std::vector<SplitNode> split_nodes;

  std::vector<std::int32_t>
      node;  ///< [nz + 2][plane], in Nodes; split ones as this block sees them

  std::vector<Facet> facets;  ///< its surface and cut faces

  std::size_t force_offset = 0;  ///< of this block's [3][nz + 2][plane] in the force buffer

  int node_count() const { return (nz + 2) * plane; }
  std::size_t lane_count() const { return static_cast<std::size_t>(nz) * 8 * stride; }
};

/// Sets pitch, stride and plane from nx, ny, nz and makes the arrays, without points.
void lay_out(Block& block);

}  // namespace tissue_sim
