// What the fragment network is told of a cell of the lattice: fragments/features.h.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fragments/features.h"
#include "fragments/pieces.h"
#include "mpm/cut_tissue.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// Of the 27 nodes that a point sees, the one at the middle of its cell.
inline constexpr int kMiddleNode = 13;

/// A point that is strained.
struct StrainedPoint {
  std::int32_t point = -1;
  float excess = 0;         ///< largest principal strain over that which its material bears
  std::uint8_t across = 0;  ///< bit a: bonds along axis a lead across the crack that may open there
};

/// Of the points that find_stretched() lists, those of tissue that may tear whose strain is at
/// least `share` of what their material bears, whatever its scatter.
std::vector<StrainedPoint> strained_of(const MpmState& state,
                                       const std::vector<StretchedPoint>& stretched, double share);
/// All such points.
inline std::vector<StrainedPoint> find_strained(MpmState& state, double share) {
  return strained_of(state, find_stretched(state, share), share);
}

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

/// The features of a point. Cells are those of the reference lattice; F is the mean over the eight
/// places of a cell's points, as the point itself sees its own cell, and as the one at its place in
/// a neighbouring cell sees that.
void fragment_features(const MpmState& state, std::int32_t point, float* x);

/// Those of surroundings, behind them: x[kFeatureCount] on. Reads the paper's from x.
void surrounding_features(const MpmState& state, const Pieces& pieces,
                          const FragmentSurroundings& around, std::int32_t point, float* x);

/// The network's features of a point's cell, x[kPartingFeatureCount]. Returns the axis (0 x, 1 y, 2
/// z) nearest to its largest stretch.
int parting_features(const MpmState& state, const Pieces& pieces,
                     const FragmentSurroundings& around, std::int32_t point, float* x);

/// Points that may soon part. Those of one cell that see one field have the same
/// features: they are one group, and asked for together.
struct FragmentCandidates {
  std::vector<std::int32_t> points;  ///< group by group, by number in each
  std::vector<std::int32_t> first;   ///< of each group, and the end
  int groups() const { return static_cast<int>(first.size()) - 1; }
};

/// From these shares of the limit's strain on points are candidates: anywhere, and beside broken
/// bonds. (Beside an open crack tissue is at rest for most of the time.)
inline constexpr float kCandidateShare = 0.7f, kCandidateAtCrack = kRegionLevels[0];

/// Those among `strained`: none of loose pieces, and none that is held.
FragmentCandidates fragment_candidates(const MpmState& state, const Pieces& pieces,
                                       const std::vector<StrainedPoint>& strained);

}  // namespace tissue_sim
