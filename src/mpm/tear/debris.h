// Debris: pieces that are too small to be seen as bodies, but whose vibration would set the substep
// of all the tissue.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/split/node_fields.h"

namespace tissue_sim {

struct AnchorFaces;

/// Marks what became soft as the points `changed` lost bonds: those of debris, and of slices one
/// point thick, which cuts parted from what there was on both sides of them along an axis of the
/// lattice. They keep the share kSoftness of their stiffness.
struct Softened {
  std::vector<std::int32_t> points;
  std::vector<std::int32_t> debris;  ///< lowest point of each, whether it was one before or not
};
Softened soften(LatticeTissue& tissue, const std::vector<std::int32_t>& changed);

/// Lets debris, each given by its lowest point, move on as rigid bodies without strain. Their
/// momentum stays, linear and angular; what else a torn bridge left in their nodes, a swing of many
/// times their size, goes. No bit of debris turns faster than kDebrisSpin times the speed of sound
/// in a rod a cell, which strains it by a tenth or two, and of tissue that tears none comes off
/// faster than the strain at its limit times that speed, as the energy that is stored there would
/// move it: the rest goes to the tissue beside it.
void settle_debris(LatticeTissue& tissue, const std::vector<std::int32_t>& debris);
/// The same for those that have become ill-conditioned since (mpm/tear/debris.h), and for the nodes
/// of ends of drawn out bridges that do not break (mpm/tear/tear.h). What the face of an anchor
/// holds goes to where that has it. Returns the points.
std::vector<std::int32_t> settle_ill_conditioned(LatticeTissue& tissue,
                                                 const std::set<std::int32_t>& debris,
                                                 const std::vector<std::int32_t>& bridge_ends,
                                                 const AnchorFaces& anchors);
inline constexpr double kDebrisSpin = 0.5;

/// Some nodes taken as one: means weighted by mass.
struct NodesMotion {
  double mass = 0;                                                          ///< [kg]
  Vec3 home = Vec3::Zero(), place = Vec3::Zero(), velocity = Vec3::Zero();  ///< [m], [m/s]
  Vec3 angular = Vec3::Zero();  ///< momentum about `place` [kg m^2/s]
  /// `home`: their reference places.
  NodesMotion(const Nodes& nodes, const std::vector<std::int32_t>& some,
              const std::vector<Vec3>& home);
};
inline Vec3 displacement_of(const Nodes& nodes, std::int32_t n) {
  return {nodes.u[0][n], nodes.u[1][n], nodes.u[2][n]};
}
/// Their inertia where they are at the places r from their middle [kg m^2].
Eigen::Matrix3d inertia_of(const Nodes& nodes, const std::vector<std::int32_t>& some,
                           const std::vector<Vec3>& r);

/// Moves the nodes of a point as a rigid body, so that they have so much more momentum [kg m/s] and
/// angular momentum about their middle [kg m^2/s].
void push(LatticeTissue& tissue, std::int32_t point, const Vec3& momentum, const Vec3& angular);

/// A bit of debris that is deformed so that it has stiffened so much is ill-conditioned.
inline constexpr double kIllConditioned = 5;

/// Deformation gradient at a point.
Eigen::Matrix3d deformation_gradient(const LatticeBody& body, const Points::Site& point,
                                     const NodeFields& fields, const Nodes& nodes);

struct Deformation {
  double stretch = 1;     ///< the largest
  double stiffening = 1;  ///< at least that of BlockState; both 1 where they are not finite
  Deformation(const LatticeBody& body, const Points::Site& point, const NodeFields& fields,
              const Nodes& nodes);
};

}  // namespace tissue_sim
