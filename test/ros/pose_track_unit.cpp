#include <gtest/gtest.h>

#include <limits>

#include "ros/pose_track.h"

namespace tissue_sim {
namespace {

Pose at(double x) { return {Vec3(x, 0, 0), Quat::Identity()}; }

PoseTrack::Verdict check(PoseTrack& track, const Pose& pose, double time) {
  return track.add(pose, time, time);
}

TEST(PoseTrack, TakesTheFirstPoseAndWhatAnArmCanReach) {
  PoseTrack c{PoseLimits()};
  EXPECT_TRUE(check(c, at(3), 100).placed);
  const PoseTrack::Verdict v = check(c, at(3.04), 100.01);
  EXPECT_FALSE(v.refusal);
  EXPECT_FALSE(v.placed);
}

TEST(PoseTrack, MakesAlmostUnitQuaternionsUnit) {
  PoseTrack c{PoseLimits()};
  EXPECT_FALSE(check(c, {Vec3::Zero(), Quat(0.707, 0, 0.707, 0)}, 0).refusal);
  EXPECT_NEAR(c.newest().orientation.norm(), 1, 1e-15);
  for (const double norm : {0.9001, 0.99, 1.0999}) {
    c.forget();
    EXPECT_FALSE(check(c, {Vec3::Zero(), Quat(0, norm, 0, 0)}, 0).refusal) << norm;
    EXPECT_NEAR(c.newest().orientation.norm(), 1, 1e-15);
  }
  EXPECT_FALSE(is_rounded(Quat(0.707, 0, 0.707, 0).norm()));
  EXPECT_TRUE(is_rounded(Quat(0.7, 0, 0.7, 0).norm()));
}

TEST(PoseTrack, RefusesWithTheReason) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  EXPECT_EQ(check(c, at(std::numeric_limits<double>::quiet_NaN()), 101).refusal,
            Refusal::kNotFinite);
  EXPECT_EQ(check(c, {Vec3::Zero(), Quat(0, 0, 0, 0)}, 101).refusal, Refusal::kNoRotation);
  EXPECT_EQ(check(c, {Vec3::Zero(), Quat(0.89, 0, 0, 0)}, 101).refusal, Refusal::kNoRotation);
  EXPECT_EQ(check(c, {Vec3::Zero(), Quat(1.11, 0, 0, 0)}, 101).refusal, Refusal::kNoRotation);
  const PoseTrack::Verdict older = check(c, at(0), 99.9);
  EXPECT_EQ(older.refusal, Refusal::kOlder);
  EXPECT_EQ(older.text, "it is 0.100 s older than the last one used");
  EXPECT_EQ(check(c, at(0.3), 100.02).refusal, Refusal::kJump);
  EXPECT_FALSE(check(c, at(0.01), 100.1).refusal) << "the good ones go on";
}

TEST(PoseTrack, TheSameStampTwiceIsNoError) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  EXPECT_FALSE(check(c, at(0.001), 100).refusal);
}

TEST(PoseTrack, PlacesAnArmThatStaysElsewhere) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  for (int i = 1; i < PoseTrack::kStay; ++i) {
    EXPECT_EQ(check(c, at(2), 100 + 0.01 * i).refusal, Refusal::kJump);
  }
  const PoseTrack::Verdict v = check(c, at(2), 100.1);
  EXPECT_FALSE(v.refusal);
  EXPECT_TRUE(v.placed);
  EXPECT_FALSE(check(c, at(2.01), 100.11).placed);
}

TEST(PoseTrack, DoesNotPlaceWhatFlickers) {
  PoseTrack c{PoseLimits()};
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

TEST(PoseTrack, BelievesAClockThatWentBackAndGoesOn) {
  for (const double rate : {0.25, 1.0, 4.0}) {  // of rosbag play
    PoseTrack c{PoseLimits()};
    c.add(at(0), 100, 1000);
    int refused = 0;
    for (int i = 0; i < 20; ++i) {  // a bag of 30 s that loops, the arm far from where it ended
      Pose pose = at(2 + 0.001 * i);
      refused += c.add(pose, 70 + 0.01 * i, 1000.01 + 0.01 / rate * i).refusal.has_value();
    }
    EXPECT_EQ(refused, 1) << rate;
  }
}

TEST(PoseTrack, DoesNotBelieveOldPosesThatComeLateAndAllAtOnce) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  for (int i = 0; i < 9; ++i) {
    Pose pose = at(0.01 * i);
    EXPECT_EQ(c.add(pose, 99 + 0.1 * i, 100.001).refusal, Refusal::kOlder);
  }
}

TEST(PoseTrack, BelievesAStampThatStaysTheSame) {  // rostopic pub -r 50 -f pose.yaml
  PoseTrack c{PoseLimits()};
  c.add(at(0), 100, 1000);
  int refused = 0;
  for (int i = 1; i <= 355; ++i) {
    Pose pose = at(0.02);
    const PoseTrack::Verdict v = c.add(pose, 50, 1000 + 0.02 * i);
    refused += v.refusal.has_value();
    EXPECT_EQ(v.placed, i == PoseTrack::kStay);
  }
  EXPECT_EQ(refused, PoseTrack::kStay - 1);
  Pose moved = at(0.12);
  EXPECT_FALSE(c.add(moved, 50, 1000 + 0.02 * 357).refusal) << "may move as time goes on";
  Pose far = at(3);
  EXPECT_TRUE(c.add(far, 50, 1000 + 0.02 * 358).refusal) << "but no faster than an arm";
}

TEST(PoseTrack, BelievesNoneOfManyWithinATenthOfASecond) {  // at 1 kHz, ten times too large
  PoseTrack c{PoseLimits()};
  check(c, at(0.1), 100);
  int refused = 0;
  for (int i = 1; i <= 200; ++i) refused += check(c, at(1), 100 + 0.001 * i).refusal.has_value();
  EXPECT_EQ(refused, 99);
}

TEST(PoseTrack, ForgetsWhereItWasWhenTimeBeginsAnew) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  c.forget();
  const PoseTrack::Verdict v = check(c, at(3), 0.5);
  EXPECT_FALSE(v.refusal);
  EXPECT_TRUE(v.placed);
  EXPECT_TRUE(v.text.empty()) << "nothing to warn of";
}

TEST(PoseTrack, AfterASilenceAnArmIsPlacedAndSweepsNothing) {
  PoseTrack c{PoseLimits()};
  check(c, at(0), 100);
  const PoseTrack::Verdict v = check(c, at(0.5), 103);
  EXPECT_FALSE(v.refusal);
  EXPECT_TRUE(v.placed);
  EXPECT_FALSE(check(c, at(0.51), 106).placed) << "so near it may have moved";
}

TEST(PoseTrack, GoesOnFromAStateWithTheNextPose) {
  for (const double x : {0.05, 0.5}) {  // within what a frame brings it, and beyond
    PoseTrack c{PoseLimits()};
    check(c, at(3), 100);
    c.go_on(at(0));
    EXPECT_TRUE(c.has_come());
    EXPECT_FALSE(c.is_known()) << "what came before is of another run";
    EXPECT_TRUE(check(c, at(std::numeric_limits<double>::quiet_NaN()), 7).refusal);
    EXPECT_FALSE(c.is_known());
    EXPECT_EQ(check(c, at(x), 7).placed, x > 0.1);
    EXPECT_EQ(c.at(7).position.x(), x);
    c.go_on(at(0));
    c.rewind(8);
    EXPECT_EQ(c.at(8).position.x(), x) << "a reset brings the newest back";
  }
}

TEST(PoseTrack, PlacesThatAreAbsurdlyFarAreRefusedAlsoAsTheFirst) {
  PoseTrack c{PoseLimits()};
  EXPECT_EQ(check(c, at(1e300), 0).refusal, Refusal::kFar);
  EXPECT_EQ(check(c, at(2e6), 0).refusal, Refusal::kFar);
  EXPECT_FALSE(check(c, at(100), 0).refusal);
}

}  // namespace
}  // namespace tissue_sim
