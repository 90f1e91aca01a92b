// Moves, what supersedes what, and the operating states.
#include "arm/joint_group.h"

#include <gtest/gtest.h>

#include <cmath>

#include "arm/operating_state.h"

namespace tissue_sim {
namespace {

std::vector<JointLimits> two() { return {{"turn", -2, 2, 1, 4}, {"slide", 0, 0.2, 0.1, 0.4}}; }

JointVector at(double turn, double slide) {
  JointVector v(2);
  v << turn, slide;
  return v;
}

TEST(JointMove, KeepsToItsSpeedsAndArrives) {
  for (const double ratio : {1.0, 0.3}) {
    for (const double turn : {1.5, -0.7, 0.05, 0.0}) {
      const JointMove move = make_move(two(), at(0.1, 0.02), at(0.1 + turn, 0.05), ratio);
      const double h = 1e-5;
      JointVector fastest = at(0, 0), hardest = at(0, 0);
      for (double t = 2 * h; t < move.duration - 2 * h; t += move.duration / 997) {
        const JointVector v = (move.position(t + h) - move.position(t - h)) / (2 * h);
        ASSERT_LT((v - move.velocity(t)).norm(), 1e-4);
        fastest = fastest.cwiseMax(v.cwiseAbs());
        hardest =
            hardest.cwiseMax(((move.velocity(t + h) - move.velocity(t - h)) / (2 * h)).cwiseAbs());
      }
      EXPECT_LE(fastest[0], ratio * 1 * 1.001);
      EXPECT_LE(fastest[1], ratio * 0.1 * 1.001);
      EXPECT_LE(hardest[0], ratio * 4 * 1.001);
      EXPECT_LE(hardest[1], ratio * 0.4 * 1.001);
      // One of the joints is at one of its limits.
      EXPECT_GT(std::max({fastest[0], fastest[1] / 0.1, hardest[0] / 4, hardest[1] / 0.4}),
                0.99 * ratio);
      EXPECT_LT((move.position(move.duration) - at(0.1 + turn, 0.05)).norm(), 1e-12);
      EXPECT_EQ(move.velocity(0).norm(), 0);
      EXPECT_LT(move.velocity(move.duration).norm(), 1e-12);
    }
  }
}

TEST(JointMove, TakesAWhileEvenWhereThereIsNoWay) {
  const JointMove move = make_move(two(), at(1, 0.1), at(1, 0.1), 1);
  EXPECT_EQ(move.duration, kShortestMove);
  EXPECT_EQ((move.position(0.02) - at(1, 0.1)).norm(), 0);
}

// Advances until it is no longer busy; how long that took.
double finish(JointGroup& group, double ratio = 1) {
  double time = 0;
  while (group.busy() && time < 60) group.advance(0.005, ratio), time += 0.005;
  return time;
}

TEST(JointGroup, MovesQueue) {
  JointGroup group(two(), at(0, 0.1));
  EXPECT_EQ(group.move(at(1, 0.1)), "");
  EXPECT_EQ(group.move(at(1, 0.15)), "");
  EXPECT_EQ(group.goal(), at(1, 0.15));
  EXPECT_TRUE(group.busy());
  bool first = false;
  while (group.busy()) {
    group.advance(0.005, 1);
    first |= group.measured() == at(1, 0.1);
  }
  EXPECT_TRUE(first);
  EXPECT_EQ(group.measured(), at(1, 0.15));
  // 1.25 s at 1 rad/s and 4 rad/s^2, then 0.75 s at 0.1 m/s and 0.4 m/s^2.
  JointGroup again(two(), at(0, 0.1));
  again.move(at(1, 0.1));
  again.move(at(1, 0.15));
  EXPECT_NEAR(finish(again), 2.0, 0.02);
  again.move(at(0, 0.1));
  EXPECT_NEAR(finish(again, 0.5), 2.25, 0.02) << "half the speed, half the acceleration";
}

TEST(JointGroup, ServoSupersedesAndIsFollowedAtALimitedSpeed) {
  JointGroup group(two(), at(0, 0.1));
  group.move(at(1, 0.1));
  group.move(at(-1, 0.1));
  group.advance(0.1, 1);
  EXPECT_EQ(group.servo(at(0.5, 0.1)), "");
  EXPECT_EQ(group.servo(at(0.6, 0.1), at(0.3, 0)), "");
  EXPECT_FALSE(group.busy());
  EXPECT_EQ(group.setpoint(), at(0.6, 0.1));
  EXPECT_EQ(group.setpoint_velocity(), at(0.3, 0));
  const double before = group.measured()[0];
  group.advance(0.1, 1);
  EXPECT_NEAR(group.measured()[0] - before, 0.4, 1e-12) << "four times the speed of moves";
  EXPECT_NEAR(group.measured_velocity()[0], 4, 1e-9);
  for (int i = 0; i < 10; ++i) group.advance(0.1, 1);
  EXPECT_EQ(group.measured(), at(0.6, 0.1));
  EXPECT_EQ(group.measured_velocity(), at(0, 0));
}

TEST(JointGroup, RefusesWhatItCannot) {
  JointGroup group(two(), at(0, 0.1));
  EXPECT_EQ(group.servo(at(0, 0.3)), "slide is 0.3, it goes from 0 to 0.2");
  EXPECT_EQ(group.move(at(std::nan(""), 0.1)), "turn is not finite");
  EXPECT_EQ(group.move(JointVector::Zero(3)), "3 positions came, there are 2 joints");
  EXPECT_NE(group.servo(at(0, 0.1), JointVector::Zero(1)), "");
  EXPECT_EQ(group.setpoint(), at(0, 0.1));
  EXPECT_FALSE(group.busy());
  group.stay();
  EXPECT_TRUE(group.busy()) << "who waits for a move that was refused does not for ever";
  EXPECT_NEAR(finish(group), kShortestMove, 0.011);
  for (std::size_t i = 0; i < JointGroup::kLongestQueue; ++i) EXPECT_EQ(group.move(at(0, 0.1)), "");
  EXPECT_EQ(group.move(at(0, 0.1)), "32 moves wait already");
}

TEST(JointGroup, HoldStaysWhereItIs) {
  JointGroup group(two(), at(0, 0.1));
  group.move(at(1, 0.1));
  group.advance(0.3, 1);
  group.servo(at(-1, 0.1));
  group.advance(0.01, 1);
  group.hold();
  EXPECT_EQ(group.setpoint(), group.measured());
  const JointVector held = group.measured();
  group.advance(1, 1);
  EXPECT_EQ(group.measured(), held);
}

TEST(OperatingState, GoesAsCrtkSays) {
  OperatingState arm;
  EXPECT_TRUE(arm.ready());
  EXPECT_EQ(command(arm, "pause"), "");
  EXPECT_EQ(not_ready(arm), "the arm is PAUSED, must be ENABLED");
  EXPECT_EQ(command(arm, "resume"), "");
  EXPECT_EQ(command(arm, "disable"), "");
  EXPECT_EQ(command(arm, "home"), "the arm is DISABLED, must be ENABLED");
  EXPECT_EQ(command(arm, "enable"), "");
  EXPECT_EQ(command(arm, "unhome"), "");
  EXPECT_EQ(not_ready(arm), "the arm is not homed: send home");
  EXPECT_EQ(command(arm, "home"), "");
  EXPECT_TRUE(arm.ready());
  EXPECT_EQ(command(arm, "fault"), "");
  EXPECT_EQ(command(arm, "enable"), "the arm is FAULT, must be DISABLED: send clear_fault");
  EXPECT_EQ(command(arm, "clear_fault"), "");
  EXPECT_EQ(arm.state, "DISABLED");
  EXPECT_NE(command(arm, "dance"), "");
}

}  // namespace
}  // namespace tissue_sim
