// The state of the material point method on the host, and a substep of it on the CPU.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "mpm/contact/touching_tissue.h"
#include "mpm/surface/boundary_mesh.h"
#include "mpm/tear/tear.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

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
  std::vector<std::vector<ColliderLoad>> block_loads;  ///< per block, per collider
};

/// The state of the tissue, and how it is worked on.
struct MpmState : TouchingTissue, TearRecords {
  float worst_stiffening = 1;  ///< BlockState's, of all blocks
  BoundaryMesh boundary;       ///< as it was last read
  BlockWork work;
};

/// All that a substep changes but contact of tissue with tissue, which each device has in its way:
/// `Motion m = motion_of(state)` keeps it, `motion_of(state) = m` puts it back.
using Motion = std::tuple<NodeMotion, FrontMotion, AnchorFaceMotion, double, float, Contacts,
                          std::vector<EdgeHold>>;
inline std::tuple<NodeMotion&, FrontMotion&, AnchorFaceMotion&, double&, float&, Contacts&,
                  std::vector<EdgeHold>&>
motion_of(MpmState& s) {
  return {s.nodes, s.front, s.anchors, s.time, s.dt, s.contacts, s.edges.holds};
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

/// One substep: forces of all blocks with contact at the colliders' present places, then the nodes.
/// Adds what acts on the colliders to `loads`. Returns how long it acted: kick_of() [s]. `anchors`
/// are where they will be at its end, empty if they stay.
float substep(MpmState& state, float dt, std::vector<ColliderLoad>& loads,
              const std::vector<RigidMotion>& anchors = {});

/// The part of it that moves all nodes, under the forces that the blocks left in `force` and the
/// front's cells in theirs.
void move_nodes(MpmState& state, const NodeStep& step);

}  // namespace tissue_sim
