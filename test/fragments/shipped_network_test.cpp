// The weights that are shipped: read, and what they say is what NumPy said of them.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>
#include <vector>

#include "fragments/network_file.h"

namespace tissue_sim {
namespace {

TEST(ShippedNetwork, SaysWhatNumpySaid) {
  const std::string shipped = std::string(TISSUE_SIM_CONFIG) + "/networks/fragments.yaml";
  const FragmentNetwork network(shipped);
  const auto expected = YAML::LoadFile(shipped)["classifier"]["of_sines"].as<std::vector<double>>();
  ASSERT_EQ(expected.size(), static_cast<std::size_t>(kOutputs));
  float x[kPartingFeatureCount], out[kOutputs];
  for (int i = 0; i < kPartingFeatureCount; ++i) x[i] = static_cast<float>(std::sin(i));
  run_network(network.weights(), x, out);
  for (int o = 0; o < kOutputs; ++o) {
    EXPECT_NEAR(out[o], expected[o], 2e-5 * (1 + std::fabs(expected[o]))) << o;
  }
  EXPECT_GT(network.threshold(), 0.05);
}

}  // namespace
}  // namespace tissue_sim
