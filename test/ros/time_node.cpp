// time: ros. Frames keep to /clock; the same poses bring the same bits however fast it goes.
#include <rosbag/bag.h>
#include <rosgraph_msgs/Clock.h>

#include <cstdlib>
#include <filesystem>
#include <map>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

Pose above(double z) { return {Vec3(0.012, 0, z), Quat(0, 1, 0, 0)}; }

// What /simulator/state said since it was made, by frame, with what came last where a frame came
// again after a reset.
class StateLog {
 public:
  StateLog() : state_("/simulator/state") {
    EXPECT_TRUE(wait_until([&] { return state_.connected(); }));
  }
  std::map<std::int64_t, SimulationState::ConstPtr> frames() const {
    std::map<std::int64_t, SimulationState::ConstPtr> frames;
    std::int64_t last = 0;
    for (const auto& s : state_.all()) {
      if (s->frame < last) frames.clear();  // a reset
      last = s->frame;
      if (s->frame > 0) frames.emplace(s->frame, s);
    }
    return frames;
  }

 private:
  Topic<SimulationState> state_;
};

// An arm's second: a probe presses, 100 poses a second, each recorded 3 ms after it was stamped.
std::string write_bag(double begin) {
  char folder[] = "/tmp/tissue_sim_time_XXXXXX";
  const std::string path = std::string(mkdtemp(folder)) + "/arm.bag";
  rosbag::Bag bag(path, rosbag::bagmode::Write);
  for (int i = 0; i < 130; ++i) {
    geometry_msgs::PoseStamped m;
    m.header.stamp = ros::Time(begin + 0.01 * i);
    m.pose = to_pose(above(i < 100 ? 0.025 - 0.00015 * i : 0.01));
    bag.write("/simulator/probe/measured_cp", m.header.stamp + ros::Duration(0.003), m);
  }
  return path;
}

void play(const std::string& bag, const std::string& options) {
  ASSERT_EQ(std::system(
                ("rosbag play --quiet --clock --hz 200 --delay 1 " + options + " " + bag).c_str()),
            0);
  ros::WallDuration(0.3).sleep();  // what is under way still comes
}

TEST(RosTime, TheSameBitsAtEveryRate) {
  const std::string bag = write_bag(1000.017);
  std::map<std::int64_t, SimulationState::ConstPtr> first;
  for (const char* rate : {"--rate 1", "--rate 4", "--rate 0.3 --duration 0.9"}) {
    StateLog log;
    play(bag, rate);
    const auto frames = log.frames();
    ASSERT_GT(frames.size(), 20u) << rate;
    ASSERT_EQ(frames.begin()->first, 1) << rate;
    ASSERT_EQ(frames.rbegin()->second->late_samples, 0u) << rate;
    if (first.empty()) first = frames;
    for (const auto& frame : frames) {
      const auto other = first.find(frame.first);
      if (other == first.end()) break;  // how long the clock goes on after the bag's end varies
      ASSERT_EQ(frame.second->checksum, other->second->checksum) << rate << ", " << frame.first;
      ASSERT_EQ(frame.second->header.stamp, other->second->header.stamp) << rate;
    }
  }
  double pressed = 0;
  for (const auto& frame : first) pressed = std::max(pressed, frame.second->elastic_energy);
  EXPECT_GT(pressed, 2 * first.at(10)->elastic_energy) << "the probe pressed";
  std::filesystem::remove_all(std::filesystem::path(bag).parent_path());
}

// The test is the clock.
class Clock {
 public:
  Clock() {
    publisher_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 1000);
    // The simulator twice (roscpp and its own), this test, and where it runs rosout.
    wait_until([&] { return publisher_.getNumSubscribers() >= 4; }, 5);
    ros::WallDuration(0.2).sleep();
  }
  void set(double time) {
    rosgraph_msgs::Clock m;
    m.clock = ros::Time(time);
    publisher_.publish(m);
    time_ = time;
  }
  // Goes on to `time`, `factor` as fast as the wall's clock.
  void run(double time, double factor = 1) {
    while (time_ < time) {
      ros::WallDuration(0.005).sleep();
      set(std::min(time, time_ + 0.005 * factor));
    }
  }

 private:
  ros::NodeHandle node_;
  ros::Publisher publisher_;
  double time_ = 0;
};

TEST(RosTime, FramesStandStillWithTheClock) {
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.connected(); }));
  Clock clock;
  clock.set(10);  // it jumps back: a scene anew, without an instrument
  clock.run(10.5);
  ASSERT_TRUE(wait_until([&] { return state.last()->frame == 31; })) << state.last()->frame;
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(state.last()->frame, 31) << "at 10 s, and then 30 more";
  clock.run(11);
  EXPECT_TRUE(wait_until([&] { return state.last()->frame == 61; })) << state.last()->frame;
  EXPECT_EQ(state.last()->late_samples, 0u);
}

TEST(RosTime, LateSamplesAreCounted) {
  Topic<SimulationState> state("/simulator/state");
  Clock clock;
  Arm probe("probe");
  clock.set(20);
  clock.set(5);
  ASSERT_TRUE(wait_until([&] { return state.last()->frame == 0; }));
  probe.send(above(0.03), "", ros::Time(5.0));
  clock.run(6);
  ASSERT_TRUE(wait_until([&] { return state.last()->frame >= 25; }));
  EXPECT_EQ(state.last()->late_samples, 0u);
  probe.send(above(0.03), "", ros::Time(5.2));  // of a frame that is long over
  ros::WallDuration(0.1).sleep();
  clock.run(6.2);
  EXPECT_TRUE(wait_until([&] { return state.last()->late_samples == 1; }));
}

TEST(RosTime, TimeThatJumpsBackResetsAndKeepsWhatIsLatched) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Topic<SimulationState> state("/simulator/state");
  Clock clock;
  Arm probe("probe");
  ros::NodeHandle node;
  ros::Publisher latched =
      node.advertise<geometry_msgs::PoseStamped>("/simulator/needle/measured_cp", 1, true);
  ASSERT_TRUE(wait_until([&] { return latched.getNumSubscribers() > 0 && inputs.connected(); }));
  geometry_msgs::PoseStamped needle;
  needle.header.stamp = ros::Time(50);
  needle.pose = to_pose(above(0.05));
  latched.publish(needle);
  clock.set(50);
  probe.send(above(0.03), "", ros::Time(50.0));
  clock.run(51);
  const auto of = [&](const char* tool) {
    for (const InstrumentMotion& m : inputs.last()->tools) {
      if (m.name == tool) return m;
    }
    return InstrumentMotion();
  };
  ASSERT_TRUE(wait_until([&] { return of("probe").present && of("needle").present; }));

  clock.set(40);  // as a bag that loops
  ASSERT_TRUE(wait_until([&] { return state.last()->frame == 0; }));
  probe.send(above(0.04), "", ros::Time(40.0));
  const std::size_t before = inputs.count();
  clock.run(40.8, 0.5);
  ASSERT_TRUE(wait_until([&] { return inputs.count() > before + 5; }));
  EXPECT_EQ(inputs.all()[before]->frame, 0);
  EXPECT_TRUE(of("needle").present) << "its pose is latched and will not come again";
  EXPECT_NEAR(of("probe").begin.position.z, 0.04, 1e-12) << "not where it was before";
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("time_test")
