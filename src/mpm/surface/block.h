// Block: a box of lattice cells that is worked on as a whole, with its points' volumes.
//
// Nodes of one z-plane are numbered flat, node (x, y) at y * pitch + x. Cells are worked on in runs
// along x, and SIMD lanes go through the runs one after the other without a gap: a row with a hole,
// or the side of an oblique cut, costs the cells that it has.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "compute/array.h"
#include "compute/host_device.h"
#include "frame/stability_limit.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/surface/facet_in_world.h"
#include "tissue_sim/material.h"

namespace tissue_sim {

inline constexpr int kLanes = 16;  ///< rows are padded for the widest instruction set

struct Block {
  int body = 0;
  int x = 0, y = 0, z = 0;     ///< first cell, in cells of the body's lattice
  int nx = 0, ny = 0, nz = 0;  ///< cells; nx: columns of nodes but two

  /// Tissue on one side of a cut, or a piece of it. Sides that are worked on together have columns
  /// of nodes of their own, side by side along x.
  struct Side {
    int column, count;
    int x;  ///< the cell with its lowest nodes in the first, in cells of the body's lattice
  };
  std::vector<Side> sides;  ///< by `column`; the first is 0, and its cell x

  int pitch = 0;   ///< nx + 2
  int stride = 0;  ///< lanes of one z-plane of cells: those of the runs, padded to whole kLanes
  int plane =
      0;  ///< nodes of one z-plane, (ny + 2) * pitch, one that is none and some to fill lanes

  /// Cells of one side with their lowest nodes in the columns x .. x + count - 1 of row y, in the
  /// lanes from `lane` on; the same in each z-plane. In order of lanes, rows and columns.
  struct Run {
    int x, y, count, lane;
  };
  std::vector<Run> runs;
  struct Span {
    int begin, end;
  };
  /// Nodes that the runs see, in a row along x and numbered one after the other, as this block sees
  /// them: lattice nodes, or fields of nodes that cuts made.
  struct NodeRow {
    int local, count;  ///< the first of them in the block's nodes: z * plane + y * pitch + x
    int node;          ///< the same in Nodes, -1 where no point sees them
  };
  std::vector<NodeRow> node_rows;         ///< in the order of the block's nodes
  std::vector<std::vector<Span>> filled;  ///< [nz]: lanes whose cells hold points that move
  std::vector<std::uint8_t>
      filled_columns;  ///< [stride]: whether a lane's cell does in any z-plane
  /// [stride]: lowest node of the lane's cell, y * pitch + x; 0 in padding. The node at dx, dy, dz
  /// (0..2) from it has the number z * plane + cell[lane] + dz * plane + dy * pitch + dx.
  std::vector<std::int32_t> cell;

  static constexpr int kMixed = -1;
  int material = 0;  ///< of all its points, in LatticeBody::materials; kMixed: see `mixture`
  /// What the points are of in a block of several materials; its arrays are empty in one of one.
  struct Mixture {
    Law law = Law::kFixedCorotated;   ///< of all, unless there are both
    Array<float> mu, lambda;          ///< [nz][8][stride], times the point's volume [J]
    Array<std::int32_t> neo_hookean;  ///< [nz][8][stride]: -1 for a point of that law, 0 for one of
                                      ///< the other; empty unless there are both
    Array<float> viscosity;  ///< [nz][stride]: of a cell's points, times their volumes, summed,
                             ///< times the share of the cell that they fill [J s]; empty where
                             ///< none is viscous
    TISSUE_SIM_FIELDS(law, mu, lambda, neo_hookean, viscosity)
  } mixture;

  Array<float> volume;        ///< [nz][8][stride]: elastic_volume(), 0 where there is no point
  Array<std::int32_t> point;  ///< [nz][8][stride], the point's number or -1

  /// A cell of which the block has so few points that it is stabilised: mpm/blocks/stabilisation.h.
  struct PartialCell {
    int lane;  ///< z * stride + its lane
    int node;  ///< its lowest, in the block's nodes
    float mu;  ///< of its points, times their volumes, summed [J]
    TISSUE_SIM_FIELDS(lane, node, mu)
  };
  std::vector<PartialCell> partial;

  std::vector<std::int32_t>
      node;  ///< [nz + 2][plane], in Nodes, -1 for none; split ones as this block sees them

  std::vector<Facet> facets;          ///< its surface and cut faces
  std::vector<SurfacePlace> surface;  ///< where tools touch these, ...
  std::vector<SurfacePlace> merged;   ///< ... and the ground

  Stiffness modulus;  ///< of its points

  int number = -1;  ///< among all that its Blocks ever had

  std::size_t force_offset = 0;  ///< of this block's [3][nz + 2][plane] in the force buffer

  int node_count() const { return (nz + 2) * plane; }
  /// Floats of one component of its nodes where a kernel copied them: whole vectors reach beyond.
  int copied_component() const { return node_count() + 2 * kLanes; }
  /// That of `sides` which has a column of nodes.
  const Side& side_at(int column) const {
    return *(std::upper_bound(sides.begin() + 1, sides.end(), column,
                              [](int c, const Side& side) { return c < side.column; }) -
             1);
  }
  /// The cell whose lowest nodes are in a column, in cells of the body's lattice along x.
  int cell_x(int column) const {
    const Side& side = side_at(column);
    return side.x + column - side.column;
  }
  std::size_t lane_count() const { return static_cast<std::size_t>(nz) * 8 * stride; }
};

/// Sets pitch, plane, stride and `cell`: what follows from nx, ny, nz and the runs.
void lay_out(Block& block);

/// Sets `filled` and `filled_columns`, when the points are there.
void find_filled(Block& block);

/// Sets Block::material and, where there are several, Block::mixture, from the block's points.
void find_materials(Block& block, const LatticeBody& body, const Points& points);

}  // namespace tissue_sim
