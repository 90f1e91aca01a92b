// The data that the fragment network learns from: the same for the same seed.
#include <gtest/gtest.h>

#include <set>
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
  options.truths = 2;
  return options;
}

TEST(Dataset, SaysWhatTruthsTearTheSameForTheSameSeed) {
  const std::vector<std::string> kinds = {"anchored", "cut", "tension"};
  const auto run = [&](int index) {
    return run_dataset_scene(make_dataset_scene(5, index, kinds), few_frames());
  };
  int torn = 0, whole = 0, differ = 0;
  for (int index = 0; index < 3; ++index) {
    const DatasetSamples one = run(index);
    const std::size_t rows = one.torn.size() / 3;
    ASSERT_GT(rows, 10u) << kinds[index];
    EXPECT_EQ(one.x.size(), rows * kPartingFeatureCount);
    for (std::size_t i = 0; i < rows; ++i) {
      const std::uint8_t a = one.torn[3 * i + 1], b = one.torn[3 * i + 2];
      EXPECT_TRUE(one.torn[3 * i] <= 1 && (a <= 1 || a == kUnknown));
      torn += a == 1;
      whole += a == 0;
      differ += a != b;
    }
    if (index > 0) continue;
    const DatasetSamples again = run(index), other = run(index + 3);
    EXPECT_EQ(one.x, again.x);
    EXPECT_EQ(one.torn, again.torn);
    EXPECT_NE(one.x, other.x);
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
