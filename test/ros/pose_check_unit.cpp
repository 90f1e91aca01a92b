#include <gtest/gtest.h>

#include <limits>

#include "ros/pose_check.h"

namespace tissue_sim {
namespace {

Pose at(double x) { return {Vec3(x, 0, 0), Quat::Identity()}; }

PoseCheck::Verdict check(PoseCheck& checker, Pose pose, double time) {
  return checker.check(pose, time);
}

TEST(PoseCheck, TakesTheFirstPoseAndWhatAnArmCanReach) {
  PoseCheck c{PoseLimits()};
  EXPECT_TRUE(check(c, at(3), 100).placed);
  const PoseCheck::Verdict v = check(c, at(3.04), 100.01);
  EXPECT_FALSE(v.refusal);
  EXPECT_FALSE(v.placed);
}

TEST(PoseCheck, MakesAlmostUnitQuaternionsUnit) {
  PoseCheck c{PoseLimits()};
  Pose pose{Vec3::Zero(), Quat(0.707, 0, 0.707, 0)};
  EXPECT_FALSE(c.check(pose, 0).refusal);
  EXPECT_NEAR(pose.orientation.norm(), 1, 1e-15);
}

TEST(PoseCheck, RefusesWithTheReason) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  EXPECT_EQ(check(c, at(std::numeric_limits<double>::quiet_NaN()), 101).refusal,
            Refusal::kNotFinite);
  EXPECT_EQ(check(c, {Vec3::Zero(), Quat(0, 0, 0, 0)}, 101).refusal, Refusal::kNoRotation);
  EXPECT_EQ(check(c, at(0), 99.9).refusal, Refusal::kOlder);
  EXPECT_EQ(check(c, at(0.3), 100.02).refusal, Refusal::kJump);
  EXPECT_FALSE(check(c, at(0.01), 100.1).refusal) << "the good ones go on";
}

TEST(PoseCheck, TheSameStampTwiceIsNoError) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  EXPECT_FALSE(check(c, at(0.001), 100).refusal);
}

TEST(PoseCheck, PlacesAnArmThatStaysElsewhere) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  for (int i = 1; i < PoseCheck::kStay; ++i) {
    EXPECT_EQ(check(c, at(2), 100 + 0.01 * i).refusal, Refusal::kJump);
  }
  const PoseCheck::Verdict v = check(c, at(2), 100.1);
  EXPECT_FALSE(v.refusal);
  EXPECT_TRUE(v.placed);
  EXPECT_FALSE(check(c, at(2.01), 100.11).placed);
}

TEST(PoseCheck, DoesNotPlaceWhatFlickers) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  for (int i = 1; i < 100; ++i) {  // a pose that is right now and then
    const double t = 100 + 0.001 * i;
    if (i % 9 == 0) {
      EXPECT_FALSE(check(c, at(0), t).refusal);
    } else {
      EXPECT_TRUE(check(c, at(2), t).refusal);
    }
  }
  for (int i = 1; i < 100; ++i) {  // wild ones that agree with nothing
    EXPECT_TRUE(check(c, at(2.0 * (i % 7) + 2), 100.2 + 0.001 * i).refusal);
  }
}

TEST(PoseCheck, TakesAnArmWhoseClockWentBack) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  int refused = 0;
  for (int i = 0; i < 20; ++i) refused += check(c, at(0), 50 + 0.01 * i).refusal.has_value();
  EXPECT_EQ(refused, PoseCheck::kStay - 1);
  PoseCheck stuck{PoseLimits()};
  check(stuck, at(0), 100);
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(check(stuck, at(0), 50).refusal) << "one old message";
}

TEST(PoseCheck, AfterASilenceAnArmIsPlacedAndSweepsNothing) {
  PoseCheck c{PoseLimits()};
  check(c, at(0), 100);
  const PoseCheck::Verdict v = check(c, at(0.5), 103);
  EXPECT_FALSE(v.refusal);
  EXPECT_TRUE(v.placed);
  EXPECT_FALSE(check(c, at(0.51), 106).placed) << "so near it may have moved";
}

}  // namespace
}  // namespace tissue_sim
