// What the fragment network says of tissue that may come apart, and what follows from it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "compute/host_device.h"
#include "fragments/network_file.h"
#include "fragments/pieces.h"
#include "mpm/fragment_features.h"
#include "mpm/mpm_state.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// How probable it is that a point is part of a fragment soon (FragmentNetwork::horizon()).
struct FragmentChance {
  std::int32_t point;
  float probability;
  double time = 0;  ///< when this was said [s]
  /// What its cell's deformation gradient will be then, row by row: mean and standard deviation of
  /// each component; 0 where it is not expected to be part of one.
  float F[9] = {}, deviation[9] = {};
  bool expected = false;  ///< it reaches FragmentNetwork::threshold(), or half where another says
  TISSUE_SIM_FIELDS(point, time, probability, F, deviation, expected)
};

/// The probability, from half on a fragment, by features x[kAllFeatureCount] of a point: the
/// network's classifier, or what it is compared with.
using FragmentClassifier =
    std::function<float(const MpmState& state, std::int32_t point, const float* x)>;

/// Of all points near their limit or beside broken bonds (mpm/fragment_features.h), by number.
/// `strained` are those from kRegionLevels[0] on, by number; nodes are where they are now.
std::vector<FragmentChance> forecast_fragments(const MpmState& state, const Pieces& pieces,
                                               std::vector<StrainedPoint> strained,
                                               const FragmentNetwork& network,
                                               const FragmentClassifier& classifier);

/// Puts what was said of points now in the place of what was said of them before, and forgets what
/// was said before `since` [s]. Both by number.
void remember(const std::vector<FragmentChance>& now, double since,
              std::vector<FragmentChance>& before);

/// Whether a piece that has come off is a fragment (loose, half a cell to 0.4 of its body) that
/// was predicted: of its points that were looked at half or more were expected to be part of one.
/// `F` is then drawn from what was said of those expected to be part of one: the mean over them,
/// and one draw of a normal distribution for each component (what is wrong for one point is for its
/// neighbours), by a counter-based generator from the scene's seed and the piece's id. Its
/// principal stretches are kept within what the material bears.
bool draw_deformation(const MpmState& state, const Pieces& pieces, int piece,
                      const std::vector<FragmentChance>& said, Eigen::Matrix3d& F);

/// A predicted piece that came off, and the deformation that it takes when it flies.
struct WaitingFragment {
  int piece = -1;    ///< Fragment::id
  double until = 0;  ///< when it is forgotten [s]
  double F[9] = {};
  TISSUE_SIM_FIELDS(piece, until, F)
};

/// What a tissue knows of its fragments to come.
struct Foresight {
  std::unique_ptr<FragmentNetwork> network;  ///< null without one
  FragmentClassifier classifier;             ///< null for the network's
  std::vector<FragmentChance> forecast;      ///< at the end of the last frame
  std::vector<FragmentChance> said;          ///< of each point the last forecast, if not long ago
  std::vector<WaitingFragment> waiting;      ///< pieces that still touch what they came off
  int flown = 0;                             ///< pieces, since the beginning
};

/// Reads the scene's network, if it has one. Throws what FragmentNetwork() throws.
Foresight make_foresight(const Scene& scene);

/// At the end of a frame that took so long [s]: lets those fly of the pieces which came off and
/// were predicted, from the end of the first frame after that one on at which they touch nothing
/// (the faces of a crack part but slowly), if that comes within the network's horizon. Returns
/// their ids.
std::vector<int> let_fly(MpmState& state, const Pieces& pieces, const FrameResult& frame,
                         double duration, Foresight& foresight);

/// Whether let_fly() has anything to look at.
bool may_fly(const FrameResult& frame, const Foresight& foresight);

/// The end of a frame that took so long [s]: what is said of the points that are strained now, and
/// how many they are.
void look_ahead(const MpmState& state, const Pieces& pieces, std::vector<StrainedPoint> strained,
                double duration, Foresight& foresight, FrameResult& result);

/// A number from the standard normal distribution, the same for the same counter.
double standard_normal(std::uint64_t seed, std::uint64_t counter);

}  // namespace tissue_sim
