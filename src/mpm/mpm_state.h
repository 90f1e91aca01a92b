// The state of the material point method on the host, and a substep of it on the CPU.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "contact/push_tool.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/blocks/block_kernels.h"
#include "mpm/blocks/blocks.h"
#include "mpm/contact/contact_inertia.h"
#include "mpm/contact/face_contact.h"
#include "mpm/fragment_flight.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/surface/boundary_mesh.h"
#include "tissue_sim/tissue.h"
#include "tools/collider.h"

namespace tissue_sim {

/// A point that touches a collider.
struct Touch : ToolMemory {
  std::int32_t cell;  ///< lane of its cell's first point, in its block
  std::int32_t point;
  std::uint8_t key;  ///< SurfacePlace::key, or kPointKey plus which of the cell's eight points
  std::uint8_t collider;
  std::uint8_t part;  ///< of the place: mpm/contact/place_parts.h
  float along[3];     ///< normal of its inerter (mpm/contact/contact_inertia.h)
  float inertia = 0;  ///< of that [kg]
};

/// A cell of which a collider may touch points before such cells are listed anew.
struct NearCell {
  std::int32_t lane;  ///< of its first point, in its block
  std::int32_t node;  ///< its lowest, in the block's nodes
  std::uint8_t collider;
  std::uint8_t points;  ///< bit s: that at sub-position s, in the body or for a blade
  std::int32_t first_place, place_count;  ///< in Block::surface or merged
  float middle[3];                        ///< reference place [m]
  std::int32_t first_part;                ///< of its places' parts, in Contacts::parts
  float lightest = -1;                    ///< largest 1 / m of its nodes, negative until asked for
  std::uint8_t clear = 0;                 ///< substeps for which no place of it can be reached
  std::uint8_t points_clear = 0;          ///< the same of its `points`
};

/// What is known of a place in such a cell, or of a part of it, until cells are listed anew.
struct NearPart {
  enum Side : std::uint8_t { kUnknown, kTowards, kAway };
  float mobility = -1;     ///< mpm/contact/face_places.h, negative until it is asked for [1/kg]
  std::uint8_t clear = 0;  ///< substeps for which the collider cannot reach it
  Side side = kUnknown;    ///< whether the surface faces the collider
};

/// Contact of points with colliders, block by block.
struct Contacts {
  std::vector<std::vector<std::uint8_t>> near;      ///< colliders that it may meet this frame
  std::vector<std::vector<NearCell>> cells;         ///< by collider, then lane
  std::vector<std::vector<NearPart>> parts;         ///< of their places
  std::vector<std::vector<Touch>> touching;         ///< by collider, cell and key
  std::vector<std::vector<InertiaChange>> changes;  ///< of the substep
  ContactInertia inertia;
  int until_list = 0;  ///< substeps until `cells` are listed anew
};

/// Within which box a block's points are, and how fast they move at most.
struct BlockMotion {
  Box box;           ///< [m]
  double speed = 0;  ///< [m/s]
};

/// Where a sweep keeps what it knows of a point: mpm/sweep_bonds.cpp.
struct SweptPoint {
  std::int32_t block, index;
};

/// What working on blocks here needs beside the state; empty where that is done on a GPU.
struct BlockWork {
  Array<float> force;        ///< of all blocks
  Array<float> u_before[3];  ///< displacements when the frame began, where a blade may cut [m]
  /// Of all points, filled for those near a sweep while it breaks bonds; null before any did.
  std::unique_ptr<SweptPoint[]> swept;
  std::vector<std::int32_t> inertial_index;            ///< per node, in ContactInertia; -1 for none
  std::vector<std::vector<ColliderLoad>> block_loads;  ///< per block, per collider
  tbb::enumerable_thread_specific<BlockScratch> scratch;
};

/// What a substep changes beside its nodes, anchors and front: see Motion.
struct TissueMotion {
  double time = 0;  ///< since the beginning [s]
  float dt = 0;     ///< the last substep, 0 before the first [s]
  Contacts contacts;
  std::vector<FragmentFlight> flights;  ///< pieces that fly
};

/// What became of the tissue.
struct TissueRecords {
  std::vector<double> tore_at;  ///< per body: when a bond last tore [s]; empty while none did
  std::vector<std::int32_t> bridge_ends;  ///< points, by number: mpm/tear/tear.h
  std::set<std::int32_t> debris;          ///< the lowest point of each: mpm/tear/debris.h
};

/// The state of the tissue, and how it is worked on.
struct MpmState : LatticeTissue, TissueMotion, TissueRecords {
  Scene scene;
  AnchorFaces anchors;
  Blocks blocks;
  FaceContacts faces;
  std::vector<BlockMotion> motion;  ///< per block; exact as of measure_motion()
  float wildest = 1;                ///< BlockState's, of all blocks
  std::vector<Collider> colliders;
  std::vector<std::int32_t> flight_of_node;  ///< -1 for none; empty while none flies
  BoundaryMesh boundary;                     ///< as it was last read

  const BlockKernels* kernels = nullptr;
  InstructionSet instructions = InstructionSet::kSse2;
  BlockWork work;
};

/// All that a substep changes but contact of tissue with tissue, which each device has in its way:
/// `Motion m = motion_of(state)` keeps it, `motion_of(state) = m` puts it back.
using Motion = std::tuple<NodeMotion, FrontMotion, AnchorFaceMotion, TissueMotion>;
inline std::tuple<NodeMotion&, FrontMotion&, AnchorFaceMotion&, TissueMotion&> motion_of(
    MpmState& s) {
  return {s.nodes, s.front, s.anchors, s};
}
/// All that a cut changes, in the same way.
inline std::tuple<NodeMasses&, PointBonds&, NodeFields&, Blocks&, FrontNodes&, AnchorRows&>
topology_of(MpmState& s) {
  return {s.nodes, s.points, *s.fields, s.blocks, s.front, s.anchors};
}

/// Fills the new `state` with a valid scene at rest, all but its blocks and what is theirs. Throws
/// what make_lattice_bodies() throws.
void make_mpm_state(const Scene& scene, NodeRange range, MpmState& state,
                    std::vector<std::string>* notes);

BlockField block_field(const MpmState& state, const Block& block);

/// Fills `motion`. Points, not nodes: a node at the rim of its body, or of a cut, that few points
/// see may swing far without moving any of them.
void measure_motion(MpmState& state);

/// One substep: forces of all blocks with contact at the colliders' present places, then the nodes.
/// Adds what acts on the colliders to `loads`. Returns how long it acted: kick_of() [s]. `anchors`
/// are where they will be at its end, empty if they stay.
float substep(MpmState& state, float dt, std::vector<ColliderLoad>& loads,
              const std::vector<RigidMotion>& anchors = {});

/// The part of it that moves all nodes, under the forces that the blocks left in `force` and the
/// front's cells in theirs.
void move_nodes(MpmState& state, const NodeStep& step);

}  // namespace tissue_sim
