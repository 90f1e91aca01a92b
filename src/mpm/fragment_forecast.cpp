#include "mpm/fragment_forecast.h"

#include <algorithm>

#include "geometry/mesh.h"

namespace tissue_sim {

std::vector<PartingChance> forecast_parting(const MpmState& state, const Pieces& pieces,
                                            std::vector<StrainedPoint> strained,
                                            const FragmentNetwork& network,
                                            const PartingClassifier& classifier) {
  const FragmentCandidates candidates = fragment_candidates(state, pieces, strained);
  if (candidates.points.empty()) return {};
  std::vector<PartingChance> chances(candidates.points.size());
  const NetworkWeights own = network.weights();
  const auto threshold = static_cast<float>(classifier ? 0.5 : network.threshold());
  const FragmentSurroundings around = fragment_surroundings(state, pieces, std::move(strained));
  state.cpu->for_each(
      candidates.groups(),
      [&](int g) {
        float x[kPartingFeatureCount];
        const std::int32_t begin = candidates.first[g], end = candidates.first[g + 1];
        const std::int32_t point = candidates.points[begin];
        parting_features(state, pieces, around, point, x);
        const float p = classifier ? classifier(state, point, x) : parting_probability(own, x);
        for (std::int32_t i = begin; i < end; ++i) {
          chances[i] = {candidates.points[i], p, p >= threshold};
        }
      },
      8);
  std::sort(chances.begin(), chances.end(),
            [](const PartingChance& a, const PartingChance& b) { return a.point < b.point; });
  return chances;
}

Foresight make_foresight(const Scene& scene) {
  Foresight foresight;
  if (scene.fragment_network != "off") {
    foresight.network =
        std::make_unique<FragmentNetwork>(resolve_path(scene.fragment_network, "fragment network"));
  }
  return foresight;
}

void look_ahead(MpmState& state, const Pieces& pieces, std::vector<StrainedPoint> strained,
                Foresight& foresight, FrameResult& result) {
  foresight.forecast = forecast_parting(state, pieces, std::move(strained), *foresight.network,
                                        foresight.classifier);
  state.expected.clear();
  for (const PartingChance& c : foresight.forecast) {
    if (c.expected) state.expected.push_back(c.point);
  }
  result.fragment_candidates = static_cast<int>(foresight.forecast.size());
  result.fragment_points = static_cast<int>(state.expected.size());
}

}  // namespace tissue_sim
