// What the GPU's kernels see of a tissue: plain structs with device pointers.
//
// A block's nodes are numbered z, y, x (x fastest) over (nz + 2)(ny + 2)(nx + 2); node `local` of a
// block has the slot first_slot + local, which is where the block puts its part of the node's
// force. The point at sub-position s (sx + 2 sy + 4 sz) of cell (x, y, z) has the lane first_lane +
// ((z * 8 + s) * ny + y) * nx + x.
#pragma once

#include <vector_types.h>

#include <cstdint>

#include "compute/some_motion.h"
#include "contact/contact_spring.h"
#include "mpm/blocks/update_node.h"
#include "mpm/cuda/face_rows.h"
#include "mpm/cuda/face_tables.h"
#include "mpm/split/front_cell.h"

namespace tissue_sim {

/// Parted nodes have their places in the arrays of nodes, behind these: how far their two sides are
/// apart with the mass of that, and how fast with one over it. So what saves, restores, displaces
/// or pushes nodes does it to them, too.
struct CudaFront {
  int cell_count = 0, node_count = 0;
  int first_node = 0;  ///< where parted nodes are in the arrays of nodes
  const FrontCell* cells = nullptr;
  const FrontPart* parts = nullptr;
  int task_count = 0;
  const int4* tasks = nullptr;  ///< a cell and a pass of it (front_warp.h), or kStabilises for what
                                ///< stabilises it; its first part, and how many there are
};
inline constexpr int kStabilises = -1;

inline constexpr int kMaxColliders = 32;  ///< a block keeps those near to it as bits of a word
inline constexpr int kMaxLayers = 16;     ///< of cells of a block

/// A material of a body and what follows from it.
struct CudaBody {
  float cell_size, inv_cell_size;  ///< [m], [1/m]
  float mu, lambda;                ///< [Pa]
  float viscosity;                 ///< [Pa s]
  float point_volume;              ///< of a whole point [m^3]
  float tear_stretch;              ///< the least limit of its points, 0 if it never tears
  float density;                   ///< [kg/m^3]
  int neo_hookean;                 ///< else fixed corotated
};

struct alignas(16) CudaBlock {
  int nx, ny, nz;  ///< cells
  int first_slot;
  int first_lane;
  int body;         ///< its CudaBody: that of its points' material
  int whole;        ///< all points are there, with CudaBody::point_volume
  int partial;      ///< some cells are stabilised
  float origin[3];  ///< reference place of local node 0 [m]
  TISSUE_SIM_INLINE int slots() const { return (nx + 2) * (ny + 2) * (nz + 2); }
};

/// Blocks of one CudaBody that a thread block works on side by side, one after the other in all
/// tables. Most are a single block; those that cuts leave small share a thread block.
struct CudaBundle {
  int body;
  int first_block, blocks;
  int first_slot, slots;
  int first_column, columns;  ///< those that hold points
  int plane_slots;            ///< of a plane of nodes of all its blocks
  int nz;                     ///< of the tallest block
  int partial;                ///< some cells are stabilised
  int rank;                   ///< among those that push contacts as well; else -1
};

/// A column of cells, for the one or two threads that walk up it.
struct alignas(16) CudaColumn {
  int slot;          ///< of the lowest of its nodes, from the bundle's first slot on
  int pitch, plane;  ///< slots from a node to the next along y and z
  int nz;            ///< cells
  int lane;          ///< of sub-position 0 of its lowest cell
  int step;          ///< lanes from a sub-position to the next
  int cell;          ///< its lowest in CudaTables::partial
  int plane_slot;    ///< the same within a plane, of the bundle's
  int whole;         ///< as CudaBlock::whole
};

/// Column `index` of a block that is alone in its bundle, all of whose columns hold points.
TISSUE_SIM_INLINE CudaColumn column_of(const CudaBlock& b, int index) {
  const int y = index / b.nx, x = index - y * b.nx;
  CudaColumn c;
  c.pitch = b.nx + 2;
  c.plane = c.pitch * (b.ny + 2);
  c.slot = y * c.pitch + x;
  c.nz = b.nz;
  c.lane = b.first_lane + index;
  c.step = b.nx * b.ny;
  c.cell = b.first_lane / 8 + index;
  c.plane_slot = c.slot;
  c.whole = b.whole;
  return c;
}

/// The points of a cell lie within so many cells of the node at its middle, stretched as they may
/// be.
inline constexpr float kCellReach = 2;

/// Into how many parts a point's place is taken apart for a thin tool, two along either side.
inline constexpr int kPlaceParts = 4;

/// A cell that colliders may push in a frame.
struct alignas(16) CudaNearCell {
  float middle[3];     ///< reference place of its middle [m]
  int node;            ///< that is there
  std::uint32_t near;  ///< bit c for a collider that it may meet
  int slot;            ///< of the lowest of its nodes
  int pitch, plane;    ///< slots from a node to the next along y and z
  int lane, step;      ///< of sub-position 0; from a sub-position to the next
  int body;            ///< its CudaBody
  int unused;
};

/// Forces of colliders and facets on the nodes, [3][nodes][kPushStride], in units of kLoadUnit as
/// integers: while one is summed up, that of the substep before is read and the third is cleared.
/// Likewise [3][nodes][kInertiaStride] what added masses bring to the nodes, xx yy zz xy yz zx, in
/// units of kInertiaUnit: added_mass.h.
inline constexpr int kPushStride =
    4;  ///< three components; 1 + a collider that has added masses there
inline constexpr int kInertiaStride = 6;
inline constexpr double kInertiaUnit = 1.0 / (1ll << 58);  ///< [kg]
struct NodePushes {
  long long* force = nullptr;
  std::size_t stride = 0;        ///< from one of the three to the next
  long long* inertia = nullptr;  ///< null where no contact has any
  std::size_t inertia_stride = 0;
};

/// State of a block at the end of a frame.
struct CudaMeasure {
  double elastic_energy, kinetic_energy;  ///< [J]
  float min[3], max[3];                   ///< of the points [m]
  float speed;                            ///< of the fastest point [m/s]
  float stiffening, worst_stiffening;     ///< see BlockState
  float square;                           ///< the largest ||F||^2
  int finite;
};

/// Displacement and mass, velocity and inverse mass of the nodes (nodes.h).
using CudaNodes = MotionOnGpu;

/// The fourth figure of CudaOuterPlace::place: the spring there stands for the surface, or is the
/// point's own.
inline constexpr float kStiffPlace = 1, kSoftPlace = 2;

/// Of a point.
struct CudaOuterPlace {
  /// At which colliders touch it, in cells from the middle of its cell; the fourth figure is 0
  /// where they touch the point itself, which has neighbours all around, or is of what a cut left
  /// one or two points thick. Where the surface is flat around the point that is straight before
  /// it, at an edge on the edge: the point's place is brought onto the surface that each of its
  /// missing bonds stands for (mpm/surface/surface_places.h). It is kSoftPlace where anchors' faces
  /// hold nodes of the point's cell: that spring needs no added mass, for faces are held as if
  /// nodes had none.
  float4 place = {0, 0, 0, 0};
  /// The plane of the surface there: its axis in the fourth figure, -1 where the place stays whole,
  /// and the normal, 1 along that. Along it places of points are next to one another.
  float4 plane = {0, 0, 0, -1};
  /// What of the surface its places stand for that look one way, that which has most [m^2].
  float area = 0;
};

struct CudaTables {
  const CudaBlock* blocks;
  const CudaBody* bodies;
  const CudaBundle* bundles;
  const CudaColumn* columns;
  int block_count, bundle_count;
  const std::int32_t* slot_node;    ///< its node n, or ~n where another block writes the node
  const std::uint32_t* slot_parts;  ///< 0: the slot has all of its node's force; else how many
                                    ///< slots share it + 64 * the first of them in `parts`; and
                                    ///< kPushed, where there is contact of tissue with tissue
  const uint4* first_parts;         ///< the first four slots that share the slot's node, or itself
  const std::uint32_t* parts;
  const float* volume;        ///< per lane, 0 where there is no point [m^3]
  const std::int32_t* point;  ///< per lane, -1 where there is none
  const float* partial;       ///< per cell (lane / 8): mu times volume of its points where they are
                              ///< fewer than seven, else 0; see mpm/blocks/stabilisation.h [J]
  const float4* outer;        ///< per point, CudaOuterPlace::place
  const float* area;          ///< likewise [m^2]
  const float4* planes;       ///< likewise; null where no tool is thin
  const std::uint8_t* bonds;  ///< per point
  const std::uint8_t* soft;   ///< per point, as Points::soft; null where none is
  const float* lightness;  ///< per point, Points::lightness, 1 where a bond broke; null where all
                           ///< are 1
  int held_by;             ///< colliders that a point may hold on to at a time: 0 to 2
  int place_parts;         ///< that a point's place may be taken apart into: kPlaceParts, or 1
  std::uint8_t* with;  ///< [point][place_parts][held_by]: 0, or 1 + index of a collider it touches
  float4*
      hold;  ///< [point][place_parts][held_by]: the place that friction holds on to, in the
             ///< collider's frame [m], and how deep contact began (contact/surface_spring.h) [m]
};

/// Sums of what acts on a collider in one substep: force and moment in units of kLoadUnit, as
/// integers, whose sum does not depend on the order; the number of points that touch a jaw, and of
/// those that lie in a tool (Collider::inside); how deep the deepest does [kInsideUnit].
inline constexpr double kLoadUnit = 1.0 / (1ll << 38);
inline constexpr int kLoadSums = 9;

/// Words of CudaFrame::arrived, and where turn_counters() and front_turns() are: in lines of memory
/// of their own.
inline constexpr int kArrivedWords = 66, kFirstTurns = 32, kFirstFrontTurns = 64;

struct CudaFrame {
  CudaNodes state[2];
  int current;       ///< which of them holds the state at the beginning
  float4* force[2];  ///< per slot
  int substeps;
  NodeStep step;
  const Collider* colliders;  ///< [substeps][collider_count]
  int collider_count;
  long long* loads;                ///< [substeps][collider_count][kLoadSums]
  const CudaNearCell* near_cells;  ///< null where no collider comes near
  const int* near_count;
  float cell_size;  ///< the scene's [m]
  NodePushes pushes;
  float grown = 0;    ///< share of what added masses are now that they are larger by than in the
                      ///< substep before, for the first one is longer
  unsigned* arrived;  ///< counters of the two barriers, and of turns; 0 at the beginning
  const CudaFaces* faces;  ///< null where no tissue touches tissue
  CudaHeldFaces held_faces;
  CudaFront front;  ///< with CudaPlan::fronts alone
};

}  // namespace tissue_sim
