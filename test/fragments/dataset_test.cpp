// The data that the fragment network learns from: the same for the same seed.
#include <gtest/gtest.h>

#include <vector>

#include "fragments/features.h"
#include "programs/dataset/dataset_run.h"

namespace tissue_sim {
namespace {

DatasetOptions few_frames() {
  DatasetOptions options;
  options.frames = 14;
  options.horizon = 4;
  options.per_frame = 20;
  options.level = 2;
  return options;
}

TEST(Dataset, IsTheSameForTheSameSeed) {
  const std::vector<std::string> kinds = {"tension", "cut"};
  const auto run = [&](std::uint64_t seed) {
    return run_dataset_scene(make_dataset_scene(seed, 1, kinds), few_frames());
  };
  const DatasetSamples one = run(5), again = run(5), other = run(6);
  ASSERT_GT(one.q.size(), 20u);
  EXPECT_EQ(one.x.size(), kAllFeatureCount * one.q.size());
  EXPECT_EQ(one.x, again.x);
  EXPECT_EQ(one.q, again.q);
  EXPECT_EQ(one.df, again.df);
  EXPECT_EQ(one.plain, again.plain);
  EXPECT_EQ(one.about, again.about);
  EXPECT_NE(one.x, other.x);
}

}  // namespace
}  // namespace tissue_sim
