// What the fragment network says of tissue that may come apart, and what follows from it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "fragments/network_file.h"
#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// How probable it is that a point is part of a fragment soon (FragmentNetwork::horizon()).
struct FragmentChance {
  std::int32_t point;
  float probability;
  double time = 0;  ///< when this was said [s]
  /// What its cell's deformation gradient will be then, row by row: mean and standard deviation of
  /// each component; 0 where it is not expected to be part of one.
  float F[9] = {}, deviation[9] = {};
  bool is_expected() const { return probability >= 0.5f; }
};

/// From this share of the limit's strain on points are looked at.
inline constexpr double kForecastShare = 0.7;

/// The probability by features x[kFeatureCount] of a point: the network's classifier, or what it is
/// compared with.
using FragmentClassifier =
    std::function<float(const MpmState& state, std::int32_t point, const float* x)>;

/// Of all points near their limit or beside broken bonds (mpm/fragment_features.h), by number.
std::vector<FragmentChance> forecast_fragments(MpmState& state, const Pieces& pieces,
                                               const FragmentNetwork& network,
                                               const FragmentClassifier& classifier);

/// Puts what was said of points now in the place of what was said of them before, and forgets what
/// was said before `since` [s]. Both by number.
void remember(const std::vector<FragmentChance>& now, double since,
              std::vector<FragmentChance>& before);

/// Whether a piece that has come off is a fragment (loose, half a cell to 0.4 of its body) that
/// was foreseen: points of it were looked at, and it was more probable than not, on average. `F` is
/// then drawn from what was said of those expected to be part of one: the mean over them, and one
/// draw of a normal distribution for each component (what is wrong for one point is for its
/// neighbours), by a counter-based generator from the scene's seed and the piece's id. Its
/// principal stretches are kept within what the material bears.
bool draw_deformation(const MpmState& state, const Pieces& pieces, int piece,
                      const std::vector<FragmentChance>& said, Eigen::Matrix3d& F);

/// A number from the standard normal distribution, the same for the same counter.
double standard_normal(std::uint64_t seed, std::uint64_t counter);

}  // namespace tissue_sim
