// What the fragment network is told of a point of the lattice: fragments/features.h.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/features.h"
#include "fragments/pieces.h"
#include "mpm/fragment_regions.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// The features of a point. Cells are those of the reference lattice; F is the mean over the eight
/// places of a cell's points, as the point itself sees its own cell, and as the one at its place in
/// a neighbouring cell sees that.
void fragment_features(const MpmState& state, std::int32_t point, float* x);

/// Those of surroundings, behind them: x[kFeatureCount] on. Reads the paper's from x.
void surrounding_features(const MpmState& state, const Pieces& pieces,
                          const FragmentSurroundings& around, std::int32_t point, float* x);

/// Points that may soon be part of a fragment. Those of one cell that see one field have the same
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
