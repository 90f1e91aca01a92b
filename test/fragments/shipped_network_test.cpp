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

/// What tissue at rest looks like: whole, in one piece, in the middle of it.
std::vector<float> at_rest() {
  using namespace surroundings;
  std::vector<float> x(kAllFeatureCount, 0.0f);
  for (int cell = 0; cell < kFeatureCells; ++cell) {
    for (int i = 0; i < 3; ++i) x[kFeaturesOfCell * cell + 4 * i] = 1;
    x[kFeaturesOfCell * cell + 9] = 1;
  }
  for (int level = 0; level < kRegionLevelCount; ++level) {
    x[kRegion + 2 * level] = 1;
    x[kRegion + 2 * level + 1] = 0.25f * std::log1p(200.0f);
  }
  x[kPiece] = 1;
  return x;
}

TEST(ShippedNetwork, ExpectsNothingOfTissueAtRest) {
  const FragmentNetwork network(kShipped);
  EXPECT_LT(fragment_probability(network.classifier(), at_rest().data()), network.threshold());
}

}  // namespace
}  // namespace tissue_sim
