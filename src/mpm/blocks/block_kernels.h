// The kernels that see points: chosen once for the processor, each works on one block.
#pragma once

#include <vector>

#include "compute/array.h"
#include "compute/simd.h"
#include "mpm/blocks/blocks.h"
#include "mpm/blocks/update_node.h"
#include "mpm/lattice/nodes.h"
#include "mpm/split/front_cell.h"
#include "mpm/surface/block.h"

namespace tissue_sim {

/// What a block's kernel needs to know beside the block.
struct BlockField {
  const Nodes* nodes;
  float cell_size;   ///< [m]
  float origin[3];   ///< reference place of the block's first node [m]
  Law law;           ///< of all the block's points; where they are mixed, Block::Mixture's
  float mu, lambda;  ///< [Pa]; not read in a mixed block
  float viscosity;   ///< [Pa s]; the same
  const std::uint8_t*
      material;              ///< of each point, Points::material; null where none has inclusions
  const std::uint8_t* soft;  ///< of each point, Points::soft; null where none is
  const float* lightness;    ///< of each point, Points::lightness; null where all are 1
  const std::uint8_t *bonds, *whole_bonds;  ///< of each point, with that alone
  int material_count;                       ///< of the body
  bool has_nodes = false;  ///< whether the kernel finds what gather() left in its scratch
};

/// The same block on a lattice of no size: positions() then gives values.
inline BlockField at_rest(BlockField f) {
  f.cell_size = f.origin[0] = f.origin[1] = f.origin[2] = 0;
  return f;
}

/// What lies between two planes across an axis: `low` to `high` of axis . x [m].
struct LaneSlab {
  float axis[3], low, high;
};
/// How far away lanes are listed, count as near, and are surely outside [m].
struct LaneReach {
  float listed, near, outside;
};
/// A lane near three slabs.
struct NearLane {
  std::int32_t lane;
  std::uint8_t outside;  ///< bits 2 i and 2 i + 1: surely below, above slab i, all the time
  bool near;             ///< to all of them at some time
};

/// Working memory of one thread; grows to the largest block and is used again.
struct BlockScratch {
  Array<float> nodes, velocities, in, in_rate, out, row, values;
  Array<std::int32_t> lanes;
  std::vector<NearLane> near;
};

/// Where a block's points are [m], and how fast the fastest moves [m/s].
struct PointBounds {
  float min[3] = {1e30f, 1e30f, 1e30f}, max[3] = {-1e30f, -1e30f, -1e30f};
  float speed = 0;  ///< not a number if that of any point is not
};

/// State of a block's points, from block_state().
struct BlockState {
  double elastic_energy = 0;  ///< [J]
  /// For each of the body's materials the largest squared column of cof F plus |J - 1| ||F||, of
  /// soft points that times kSoftness, 1 at least: see stable_substep(); then ||F||^2 of all. Less
  /// of points behind the faces of anchors: Points::lightness.
  std::vector<float> stiffening;
  float worst_stiffening = 1;  ///< the largest of all points, soft and light ones not lessened
  bool finite = true;
};

struct BlockKernels {
  /// Copies the displacements of the block's nodes into the scratch, where forces() can use them:
  /// [3][nz + 2][plane], Block::copied_component() floats from one component to the next. [m]
  const float* (*gather)(const Block&, const Array<float>* u, BlockScratch&);
  /// Internal force on the block's nodes, [3][nz + 2][plane] (components as planes of their own):
  /// f_i = -sum_p V_p P(F_p) grad w_ip. [N]
  void (*forces)(const Block&, const BlockField&, BlockScratch&, float* force);
  /// Places of the points in the world [m], for displacements `u`[3]: out[3][nz][8][stride]. Lanes
  /// without a point hold something finite. With a field from at_rest(), the value of any node
  /// field at the points, as sum_i w_ip u_i.
  void (*positions)(const Block&, const BlockField&, const Array<float>* u, BlockScratch&,
                    float* out);
  PointBounds (*bounds)(const Block&, const BlockField&, BlockScratch&);
  /// Lanes of `positions` that lie within a box, in order, into `lanes`; returns their number.
  int (*lanes_in_box)(const float* positions, std::size_t lane_count, const float* min,
                      const float* max, std::int32_t* lanes);
  /// Lists the lanes that come near all of three slabs while they move from `begin` to `end`, both
  /// as `positions`; returns their number.
  int (*lanes_near)(const LaneSlab (&slabs)[3], const LaneReach&, const float* begin,
                    const float* end, std::size_t lane_count, NearLane* near);
  /// Sums the parts of a row's force and moves its nodes on.
  void (*update_row)(const NodeRow&, const RowPart* parts, const float* force, const UpdateNode&);
  /// Energy and stiffness of the block; with `von_mises` also each point's stress [Pa], one per
  /// lane.
  BlockState (*state)(const Block&, const BlockField&, BlockScratch&, float* von_mises);
  /// The same without energy and stress.
  BlockState (*stiffness)(const Block&, const BlockField&, BlockScratch&);
  /// Appends the points whose largest principal stretch is at least `stretch`, in a fixed order.
  void (*stretched)(const Block&, const BlockField&, float stretch, BlockScratch&,
                    std::vector<StretchedPoint>& found);
  /// What a cell at the front of a cut adds to the forces: on its nodes, [27][4], and on its parts,
  /// [FrontCell::count][4] [N]; and the energy of that [J].
  void (*front)(const FrontCell&, const FrontField&, float* force, float* pull);
  double (*front_energy)(const FrontCell&, const FrontField&);
};

const BlockKernels& block_kernels(InstructionSet set);

// One file each: block_kernels_*.cpp. Those of AVX only on x86-64.
const BlockKernels& block_kernels_sse2();
const BlockKernels& block_kernels_avx2();
const BlockKernels& block_kernels_avx512();

}  // namespace tissue_sim
