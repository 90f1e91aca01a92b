// The data that the fragment network learns from: the same for the same seed, shared out whole.
#include <gtest/gtest.h>

#include <cstdlib>
#include <vector>

#include "fragments/features.h"
#include "programs/dataset/dataset_run.h"
#include "programs/dataset/rank.h"

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

TEST(Dataset, IsSharedOutByRank) {
  for (const int ranks : {1, 2, 3, 7}) {
    std::vector<int> done(20, 0);
    for (int r = 0; r < ranks; ++r) {
      const Rank rank{r, ranks, 1};
      for (int i = 0; i < count_of(rank, 20); ++i) ++done[item_of(rank, i)];
    }
    EXPECT_EQ(done, std::vector<int>(20, 1)) << ranks;
  }
  EXPECT_EQ(count_of({5, 7, 1}, 3), 0);
}

TEST(Dataset, LauncherSaysTheRank) {
  const auto set = [](const char* number, const char* of) {
    setenv("OMPI_COMM_WORLD_RANK", number, 1);
    setenv("OMPI_COMM_WORLD_SIZE", of, 1);
  };
  set("2", "5");
  EXPECT_EQ(launched_rank().number, 2);
  EXPECT_EQ(launched_rank().of, 5);
  set("5", "5");
  EXPECT_THROW(launched_rank(), std::invalid_argument);
  unsetenv("OMPI_COMM_WORLD_RANK");
  unsetenv("OMPI_COMM_WORLD_SIZE");
}

}  // namespace
}  // namespace tissue_sim
