// time: lockstep. Each sample of the instruments is a frame, and the node is the clock.
#include <rosgraph_msgs/Clock.h>
#include <tissue_sim/LoadScene.h>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

Pose above(double z) { return {Vec3(0.012, 0, z), Quat(0, 1, 0, 0)}; }

std::int64_t frame(const Topic<SimulationState>& state) { return state.last()->frame; }

class Lockstep : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(wait_until([&] { return state_.connected(); }));
    trigger("reset");
    ASSERT_TRUE(wait_until([&] { return frame(state_) == 0; }));
  }
  Topic<SimulationState> state_{"/simulator/state"};
};

TEST_F(Lockstep, EachSampleIsAFrame) {
  Arm probe("probe");
  for (int i = 1; i <= 100; ++i) {
    probe.send(above(0.03 - 0.0001 * i));
    ASSERT_TRUE(wait_until([&] { return frame(state_) == i; })) << i << ", " << frame(state_);
  }
  for (int i = 0; i < 50; ++i) probe.send(above(0.02));  // none is passed over
  EXPECT_TRUE(wait_until([&] { return frame(state_) == 150; })) << frame(state_);
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(frame(state_), 150) << "nothing goes on by itself";
}

TEST_F(Lockstep, TheSlowerOneIsWaitedFor) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Arm probe("probe"), hook("hook");
  ASSERT_TRUE(wait_until([&] { return inputs.connected(); }));
  for (int i = 1; i <= 30; ++i) {
    probe.send(above(0.03 + 0.001 * i));
    if (i % 3 == 0) {
      for (int k = 2; k >= 0; --k) hook.send(above(0.1 + 0.001 * (i - k)));
    }
    if (i % 3 != 0) ros::WallDuration(0.02).sleep();
    ASSERT_TRUE(wait_until([&] { return frame(state_) == i - i % 3; })) << i;
  }
  ASSERT_TRUE(wait_until([&] { return inputs.count() == 30; }));
  for (const auto& input : inputs.all()) {  // sample by sample
    const double z = 0.001 * static_cast<double>(input->frame + 1);
    EXPECT_NEAR(input->tools[1].end.position.z, 0.03 + z, 1e-12);
    EXPECT_NEAR(input->tools[2].end.position.z, 0.1 + z, 1e-12);
  }
}

TEST_F(Lockstep, StepsAndCutsAdvanceIt) {
  EXPECT_EQ(step(7).frame, 7);
  const auto cut = call<Cut>("cut", plane_cut(0.001));
  EXPECT_TRUE(cut.success) << cut.message;
  EXPECT_EQ(step(1).frame, 9);
}

TEST_F(Lockstep, TheNodeIsTheClock) {
  Topic<rosgraph_msgs::Clock> clock("/clock");
  ASSERT_TRUE(clock.last());
  const ros::Time before = clock.last()->clock;
  EXPECT_FALSE(before.isZero());
  const ros::WallTime start = ros::WallTime::now();
  ASSERT_TRUE(step(120).success);
  EXPECT_TRUE(wait_until([&] { return clock.last()->clock >= before + ros::Duration(2); }));
  EXPECT_NEAR((clock.last()->clock - before).toSec(), 2, 1e-7);
  EXPECT_LT((ros::WallTime::now() - start).toSec(), 60);
  // Topics of their own: one may come before the other.
  EXPECT_TRUE(wait_until([&] { return state_.last()->header.stamp == clock.last()->clock; }));
  // A client that keeps to it: a loop at 60 Hz, which goes as fast as the simulation.
  Arm probe("probe");
  const std::int64_t first = frame(state_);
  ros::Rate rate(60);
  for (int i = 0; i < 30; ++i) {
    probe.send(above(0.03), "", ros::Time::now());
    rate.sleep();
  }
  EXPECT_TRUE(wait_until([&] { return frame(state_) == first + 30; })) << frame(state_) - first;
  trigger("reset");  // goes on: who follows it is not set back
  step(1);
  EXPECT_GT(clock.last()->clock, before + ros::Duration(2.4));
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("lockstep_test")
