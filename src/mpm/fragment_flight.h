// Fragments that fly: from when a predicted piece has come off until it touches tissue, the ground
// or a tool it moves as a rigid body, whatever its points are strained by (Sung, Kim and Shin,
// Electronics 13:1340, 2024, section 3.1; what they leave open, momentum, is kept here).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "compute/host_device.h"
#include "fragments/pieces.h"
#include "mpm/blocks/update_node.h"

namespace tissue_sim {

struct MpmState;

/// Of the 27 nodes that a point sees, the one at the middle of its cell.
inline constexpr int kMiddleNode = 13;

/// A piece that flies. Its nodes are its own: each field of a node is one piece's.
struct FragmentFlight {
  int piece = -1;                   ///< Fragment::id
  std::vector<std::int32_t> nodes;  ///< by number
  std::vector<Vec3> home;           ///< their reference places [m]
  std::vector<Vec3> from_centre;    ///< where they were when it took off [m]
  Eigen::Matrix3d inertia;          ///< then [kg m^2]
  Eigen::Matrix3d rotation;         ///< since then
  Vec3 centre;                      ///< of mass [m]
  Vec3 velocity;                    ///< of that [m/s]
  Vec3 angular;                     ///< momentum about it [kg m^2/s]
  TISSUE_SIM_FIELDS(piece, nodes, home, from_centre, inertia, rotation, centre, velocity, angular)
};

/// Deforms a piece evenly and lets it fly. Of all displacements with the deformation gradient F its
/// nodes take the nearest, weighted by mass: the one that keeps the centre of mass. Linear and
/// angular momentum stay; what else moved in it goes. Returns false, with nothing changed, where
/// the piece is held or where it does not move by finite numbers.
bool take_off(MpmState& state, const Pieces& pieces, int piece, const Eigen::Matrix3d& F);

/// Whether a piece touches another one, the ground or a tool, as of the last substep.
bool touches_anything(const MpmState& state, const Pieces& pieces, int piece);

/// After a substep: pieces that touch something are part of the physics again, the others move on.
void fly(MpmState& state, const NodeStep& step);

/// The same once a frame of `substeps` that took `duration` [s], where substeps cannot be stopped
/// for it (on a GPU): within the frame the pieces were part of the physics, which keeps momentum,
/// and take their shape again, turned on, at its end. What had another momentum then than gravity
/// and damping [1/s] give it has touched something. Returns the nodes that were moved.
std::vector<std::int32_t> fly_frame(MpmState& state, double duration, int substeps);

/// Before the points `changed`, which lost bonds, are taken apart: what flies and loses bonds is
/// part of the physics again.
void land_changed(MpmState& state, const std::vector<std::int32_t>& changed);

/// Makes MpmState::flight_of_node anew.
void index_flights(MpmState& state);

}  // namespace tissue_sim
