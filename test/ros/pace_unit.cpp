#include <gtest/gtest.h>

#include "ros/pace.h"
#include "ros/warn_seldom.h"

namespace tissue_sim {
namespace {

using std::chrono::milliseconds;

const WallTime kStart{std::chrono::hours(1)};

TEST(Pace, FramesAreDueAtTheirRate) {
  Pace pace(100);
  pace.restart(kStart);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(pace.due(), kStart + i * milliseconds(10));
    pace.begin_frame(pace.due() + milliseconds(3));  // a little late: the rate holds
  }
}

TEST(Pace, NeverCatchesUp) {
  Pace pace(100);
  pace.restart(kStart);
  pace.begin_frame(kStart + milliseconds(500));
  EXPECT_EQ(pace.due(), kStart + milliseconds(510));
}

TEST(Seldom, IsDueAtFirstAndThenOnceAPeriod) {
  Seldom seldom(1);
  EXPECT_TRUE(seldom.due(kStart));
  EXPECT_FALSE(seldom.due(kStart + milliseconds(999)));
  EXPECT_TRUE(seldom.due(kStart + milliseconds(1000)));
  EXPECT_FALSE(seldom.due(kStart + milliseconds(1001)));
}

TEST(RealTimeFactor, LooksAtTheLastSecond) {
  RealTimeFactor factor;
  EXPECT_EQ(factor.value(), 0);
  for (int i = 0; i <= 200; ++i) factor.add(kStart + i * milliseconds(10), 0.01 * i);
  EXPECT_NEAR(factor.value(), 1, 1e-9);
  for (int i = 1; i <= 150; ++i) factor.add(kStart + milliseconds(2000 + 10 * i), 2 + 0.005 * i);
  EXPECT_NEAR(factor.value(), 0.5, 1e-9);
}

TEST(Throttle, LetsThroughAnEvenShare) {
  Throttle half(30, 60), all(60, 60), every(0, 60), odd(25, 60);
  int halves = 0, alls = 0, everies = 0, odds = 0;
  for (int i = 0; i < 600; ++i) {
    const double now = seconds(kStart) + 1e-6 * (i * 16667 + (i * 7919) % 2000);
    halves += half.due(now);
    alls += all.due(now);
    everies += every.due(now);
    odds += odd.due(now);
  }
  EXPECT_EQ(halves, 300);
  EXPECT_EQ(alls, 600);
  EXPECT_EQ(everies, 600);
  EXPECT_NEAR(odds, 250, 2);
}

}  // namespace
}  // namespace tissue_sim
