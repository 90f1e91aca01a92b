#include "mpm/fragment_forecast.h"

#include "mpm/fragment_features.h"

namespace tissue_sim {

std::vector<FragmentChance> forecast_fragments(MpmState& state, const Pieces& pieces,
                                               const FragmentNetwork& network) {
  const std::vector<std::int32_t> points = fragment_candidates(state, pieces, kForecastShare);
  std::vector<FragmentChance> chances(points.size());
  const NetworkWeights classifier = network.classifier();
  state.cpu->for_each(
      static_cast<int>(points.size()),
      [&](int i) {
        float x[kFeatureCount];
        fragment_features(state, points[i], x);
        chances[i] = {points[i], fragment_probability(classifier, x)};
      },
      32);
  return chances;
}

}  // namespace tissue_sim
