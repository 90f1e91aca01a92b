// The data that the fragment network learns from: the same for the same seed.
#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "fragments/features.h"
#include "mpm/parting_features.h"
#include "programs/dataset/parting_run.h"

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

TEST(Dataset, SaysWhichBondsTruthsTear) {
  const std::vector<std::string> kinds = {"anchored", "cut", "tension"};
  const auto run = [&](int index) {
    return run_parting_scene(make_dataset_scene(5, index, kinds), few_frames(), 2);
  };
  int torn = 0, whole = 0, differ = 0;
  for (int index = 0; index < 3; ++index) {
    const PartingSamples one = run(index);
    const std::size_t rows = one.torn.size() / 3;
    ASSERT_GT(rows, 10u) << kinds[index];
    EXPECT_EQ(one.x.size(), rows * parting::kEnd);
    for (std::size_t i = 0; i < rows; ++i) {
      const std::uint8_t a = one.torn[3 * i + 1], b = one.torn[3 * i + 2];
      EXPECT_TRUE(one.torn[3 * i] <= 1 && (a <= 1 || a == kUnknown));
      torn += a == 1;
      whole += a == 0;
      differ += a != b;
    }
    if (index > 0) continue;
    const PartingSamples again = run(index);
    EXPECT_EQ(one.x, again.x);
    EXPECT_EQ(one.torn, again.torn);
  }
  EXPECT_GT(torn, 5);
  EXPECT_GT(whole, 20);
  EXPECT_GT(differ, 0) << "lattices lie otherwise";
  EXPECT_LT(differ, (torn + whole) / 2) << "but the scene is one";
}

TEST(Dataset, TruthsAreJitteredWithinFivePercent) {
  const DatasetScene scene = make_dataset_scene(5, 0, {"tension"});
  std::set<double> levels;
  for (int truth = 0; truth < 8; ++truth) levels.insert(jittered(scene, 3, truth));
  EXPECT_EQ(levels.size(), 8u);
  EXPECT_GE(*levels.begin(), 2.85);
  EXPECT_LE(*levels.rbegin(), 3.15);
  EXPECT_GT(*levels.rbegin() - *levels.begin(), 0.2);
}

}  // namespace
}  // namespace tissue_sim
