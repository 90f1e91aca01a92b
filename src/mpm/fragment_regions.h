// Regions of tissue that may come off: what holds together where bonds that are strained nearly to
// their limit count as broken.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fragments/features.h"
#include "fragments/pieces.h"
#include "mpm/lattice_pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// A point that is strained.
struct StrainedPoint {
  std::int32_t point;
  float excess;         ///< largest principal strain over that of the limit
  std::uint8_t across;  ///< bit a: bonds along axis a lead across the crack that may open there
};

/// Of the points that are stretched most, those of tissue that may tear whose strain is at least
/// `share` of their limit's, by number.
std::vector<StrainedPoint> strained_of(const MpmState& state,
                                       const std::vector<StretchedPoint>& stretched, double share);

/// All such points, by number.
std::vector<StrainedPoint> find_strained(MpmState& state, double share);

/// Where the points of a piece are on its lattice [sites], and how they move.
struct PieceSpread {
  double volume = 0, points = 0, moving = 0;  ///< [m^3]; those whose velocity was added
  Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// One way to divide tissue into what holds together.
struct Division {
  std::vector<PointRun> runs;
  std::vector<std::int32_t> root;   ///< of each run: the first of its region
  std::vector<PieceSpread> region;  ///< by root; only those of the level kMovingLevel move
  const PieceSpread& of(std::int32_t point) const;
};
inline constexpr int kMovingLevel = 1;

/// What the points of a frame have around them.
struct FragmentSurroundings {
  std::vector<StrainedPoint> strained;
  Division levels[kRegionLevelCount];
  std::vector<PieceSpread> pieces;  ///< by Fragment::id
  std::vector<double> of_body;      ///< volume [m^3]
};

/// `strained` are those from kRegionLevels[0] on, by number. Works on all levels side by side.
FragmentSurroundings fragment_surroundings(const MpmState& state, const Pieces& pieces,
                                           std::vector<StrainedPoint> strained);

}  // namespace tissue_sim
