// The weights that are shipped: read, and what they say is what NumPy said of them.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>
#include <vector>

#include "fragments/network_file.h"

namespace tissue_sim {
namespace {

const std::string kShipped = std::string(TISSUE_SIM_CONFIG) + "/networks/fragments.yaml";

template <int kOutputs>
void expect_sines(const NetworkWeights& weights, const std::vector<double>& expected) {
  ASSERT_EQ(expected.size(), static_cast<std::size_t>(kOutputs));
  float x[kAllFeatureCount], out[kOutputs];
  for (int i = 0; i < weights.inputs; ++i) x[i] = static_cast<float>(std::sin(i));
  run_network(weights, x, out);
  for (int o = 0; o < kOutputs; ++o) {
    EXPECT_NEAR(out[o], expected[o], 2e-5 * (1 + std::fabs(expected[o]))) << o;
  }
}

TEST(ShippedNetwork, SaysWhatNumpySaid) {
  const FragmentNetwork network(kShipped);
  const YAML::Node file = YAML::LoadFile(kShipped);
  expect_sines<kClassifierOutputs>(network.classifier(),
                                   file["classifier"]["of_sines"].as<std::vector<double>>());
  expect_sines<kModifierOutputs>(network.modifier(),
                                 file["modifier"]["of_sines"].as<std::vector<double>>());
}

/// A strained cell of a whole piece; its features but for what follows.
std::vector<float> strained_cell() {
  using namespace surroundings;
  std::vector<float> x(kAllFeatureCount, 0.0f);
  for (int cell = 0; cell < kFeatureCells; ++cell) {
    for (int i = 0; i < 3; ++i) x[kFeaturesOfCell * cell + 4 * i] = 1;
    x[kFeaturesOfCell * cell + 9] = 1;
    x[kExcess + cell] = 0.8f;
  }
  x[kOther] = -0.1f;
  x[kOther + 1] = -0.5f;
  for (int level = 0; level < kRegionLevelCount; ++level) {
    x[kRegion + 2 * level] = 1;
    x[kRegion + 2 * level + 1] = 0.25f * std::log1p(200.0f);
  }
  x[kPiece] = 1;
  return x;
}

TEST(ShippedNetwork, ExpectsMoreOfAnEndThatHangsOnByStrainedBondsAndLeaves) {
  using namespace surroundings;
  const FragmentNetwork network(kShipped);
  std::vector<float> inner = strained_cell(), end = strained_cell();
  inner[kAlongGradient] = inner[kAlongStretch] = inner[kFromCentre] = 1;
  for (int level = 0; level < 3; ++level) {
    end[kRegion + 2 * level] = 0.2f;
    end[kRegion + 2 * level + 1] = 0.25f * std::log1p(40.0f);
  }
  end[kAlongGradient] = end[kAlongStretch] = -1.5f;
  end[kFromCentre] = 1.5f;
  end[kSpeed] = end[kParting] = 0.5f;
  end[kRate] = 0.4f;
  const auto probability = [&](const std::vector<float>& x) {
    return fragment_probability(network.classifier(), x.data());
  };
  EXPECT_GT(probability(end), network.threshold());
  EXPECT_LT(probability(inner), network.threshold());
}

}  // namespace
}  // namespace tissue_sim
