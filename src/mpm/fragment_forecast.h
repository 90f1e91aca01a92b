// What the fragment network says of tissue that may come apart.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/network_file.h"
#include "fragments/pieces.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// How probable it is that a point is part of a fragment soon (FragmentNetwork::horizon()).
struct FragmentChance {
  std::int32_t point;
  float probability;
};

/// From this share of the limit's strain on points are looked at.
inline constexpr double kForecastShare = 0.7;

/// Of all points near their limit or beside broken bonds (mpm/fragment_features.h), by number.
std::vector<FragmentChance> forecast_fragments(MpmState& state, const Pieces& pieces,
                                               const FragmentNetwork& network);

}  // namespace tissue_sim
