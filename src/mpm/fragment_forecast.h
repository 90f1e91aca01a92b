// What the fragment network says of tissue that may part, and what follows from it: cracks begin
// sooner where it expects them (kWhereExpected).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "fragments/network_file.h"
#include "fragments/pieces.h"
#include "mpm/fragment_features.h"
#include "mpm/mpm_state.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// How probable it is that a point's cell parts soon (FragmentNetwork::horizon()).
struct PartingChance {
  std::int32_t point;
  float probability;
  bool expected;  ///< it reaches FragmentNetwork::threshold(), or half where another says
};

/// The probability, from half on that it parts, by features x[kPartingFeatureCount] of a point: the
/// network's, or what it is compared with.
using PartingClassifier =
    std::function<float(const MpmState& state, std::int32_t point, const float* x)>;

/// Of all points near their limit or beside broken bonds (mpm/fragment_features.h), by number.
/// `strained` are those from kRegionLevels[0] on, by number; nodes are where they are now.
std::vector<PartingChance> forecast_parting(const MpmState& state, const Pieces& pieces,
                                            std::vector<StrainedPoint> strained,
                                            const FragmentNetwork& network,
                                            const PartingClassifier& classifier);

/// What a tissue knows of its fragments to come.
struct Foresight {
  std::unique_ptr<FragmentNetwork> network;  ///< null without one
  PartingClassifier classifier;              ///< null for the network's
  std::vector<PartingChance> forecast;       ///< at the end of the last frame
};

/// Reads the scene's network, if it has one. Throws what FragmentNetwork() throws.
Foresight make_foresight(const Scene& scene);

/// The end of a frame: what is said of the points that are strained now, which of them are expected
/// to part from now on (TearRecords::expected), and how many they are.
void look_ahead(MpmState& state, const Pieces& pieces, std::vector<StrainedPoint> strained,
                Foresight& foresight, FrameResult& result);

}  // namespace tissue_sim
