// The lengths of a part's substeps: they take the time they should, and change little by little.
#include "frame/part_substeps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tissue_sim {
namespace {

TEST(PartSubsteps, TakeTheirTimeAndChangeLittleByLittle) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> log_ratio(-1.5, 1.5), log_time(0, 5);
  for (int trial = 0; trial < 2000; ++trial) {
    const double before = 2e-4, longest = before * std::exp(log_ratio(random));
    const double time = before * std::exp(log_time(random)), most = 1.1 * longest;
    const PartSubsteps s = substeps_for(time, longest, before, most);
    ASSERT_GE(s.count, 1);
    double sum = 0, last = before;
    for (int i = 0; i < s.count; ++i) {
      const double dt = s.at(i);
      ASSERT_NEAR(s.until(i), sum, 1e-6 * time);
      EXPECT_LE(dt, 1.0501 * last);  // on the way up
      if (i > 0) {
        EXPECT_GE(dt, last / 1.0501);
      }
      EXPECT_LE(dt, 1.0001 * std::max(most, longest));
      if (s.is_even_from(i)) {
        EXPECT_LE(dt, 1.0001 * longest);
      }
      sum += dt;
      last = dt;
    }
    EXPECT_NEAR(sum, time, 1e-6 * time);
    EXPECT_NEAR(s.share(s.count, 0.25, 0.75), 0.75, 1e-12);
    // As few as can be: with one less, and as long as they may be, they would not reach.
    double least = 0, length = std::min(before * 1.05, longest);
    if (longest < before) length = std::max(longest, std::min(before / 1.05, most));
    for (int i = 0; i + 1 < s.count; ++i) {
      least += length;
      length =
          length < longest ? std::min(longest, 1.05 * length) : std::max(longest, length / 1.05);
    }
    EXPECT_LT(least, 1.0001 * time);
  }
}

TEST(PartSubsteps, AreShortAtOnceWhereTheyMustBe) {
  for (const double before : {0.0, 1e-4, 3e-4}) {
    const PartSubsteps s = substeps_for(1e-3, 1e-4, before, 0);
    EXPECT_EQ(s.count, 10);
    EXPECT_TRUE(s.is_even_from(0));
    EXPECT_FLOAT_EQ(s.longest(), 1e-4f);
  }
  EXPECT_EQ(substeps_for(1e-3, 0, 1e-4, 0).count, 1);  // of tissue that blew up
}

}  // namespace
}  // namespace tissue_sim
