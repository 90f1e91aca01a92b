// What the node records, `replay` runs again: executable and launch file.
#include <ros/package.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/JointState.h>
#include <sys/wait.h>
#include <tissue_sim/LoadScene.h>
#include <tissue_sim/RestoreState.h>
#include <tissue_sim/SaveState.h>
#include <tissue_sim/StartRecording.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

struct Ended {
  int code = -1;
  std::string said;
};

Ended run(const std::string& command) {
  Ended ended;
  FILE* const pipe = popen((command + " 2>&1").c_str(), "r");
  for (char line[512]; std::fgets(line, sizeof line, pipe);) ended.said += line;
  const int status = pclose(pipe);
  if (WIFEXITED(status)) ended.code = WEXITSTATUS(status);
  return ended;
}

// Beside this test, in the devel space.
Ended replay(const std::string& arguments) {
  return run("'" + (fs::read_symlink("/proc/self/exe").parent_path() / "replay").string() + "' " +
             arguments);
}

std::string folder() {
  std::string folder;
  EXPECT_TRUE(ros::param::get("/simulator/recording_folder", folder));
  return folder;
}

class Cleanup : public testing::Environment {
  void TearDown() override {
    if (folder().find("/tmp/") == 0) fs::remove_all(folder());
  }
};
testing::Environment* const kCleanup = testing::AddGlobalTestEnvironment(new Cleanup);

void start(const std::string& name, const std::vector<std::string>& topics = {}) {
  StartRecording::Request request;
  request.path = name;
  request.topics = topics;
  const auto reply = call<StartRecording>("start_recording", request);
  ASSERT_TRUE(reply.success) << reply.message;
}

std::map<std::string, int> counts(const std::string& path) {
  std::map<std::string, int> counts;
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  for (const rosbag::MessageInstance& m : rosbag::View(bag)) ++counts[m.getTopic()];
  return counts;
}

// A session with everything in it: instruments, jaws, cuts, a pause, steps, resets, another scene.
void record_session(const std::string& name) {
  pause(true);
  trigger("reset");
  step(3);  // what the bag does not hold the beginning of
  start(name, {"state"});
  step(2);
  trigger("reset");
  Arm probe("probe"), scalpel("scalpel"), grasper("grasper");
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/grasper/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  pause(false);
  for (int i = 0; i < 30; ++i) {
    probe.send({Vec3(0.012, 0, 0.027 - 0.0003 * i), Quat(0, 1, 0, 0)});
    grasper.send({Vec3(-0.008, 0, 0.016), Quat(0, 1, 0, 0)});
    sensor_msgs::JointState jaw;
    jaw.header.stamp = ros::Time::now();
    jaw.position = {0.7 - 0.02 * i};
    jaws.publish(jaw);
    ros::WallDuration(0.01).sleep();
  }
  scalpel.sweep(blade_pose(0.001, -0.025, -0.004), blade_pose(0.001, 0.01, -0.004), 0.3);
  pause(true);
  probe.send({Vec3(0.012, 0, 0.03), Quat(0, 1, 0, 0)});
  EXPECT_TRUE(call<Cut>("cut", plane_cut(-0.009)).success);
  step(5);
  LoadScene::Request scene;
  scene.yaml =
      "{name: other, cell_size: 0.005, bodies: [{shape: ball, radius: 0.012, pose: {position: [0, "
      "0, "
      "0.02]}}], tools: [{name: hook, type: probe}]}";
  const auto loaded = call<LoadScene>("load_scene", scene);
  EXPECT_TRUE(loaded.success) << loaded.message;
  step(10);
  ASSERT_TRUE(trigger("stop_recording").success);
}

TEST(ReplayNode, AWholeSessionComesOutBitForBit) {
  record_session("session");
  const std::string bag = folder() + "/session.bag";
  const Ended same = replay(bag);
  EXPECT_EQ(same.code, 0) << same.said;
  EXPECT_NE(same.said.find("of 3 runs"), std::string::npos) << same.said;
  EXPECT_EQ(same.said.find("left out"), std::string::npos) << same.said;
  EXPECT_NE(same.said.find("the same"), std::string::npos) << same.said;

  // Recorded anew with all topics, through the launch file; and that bag is one of the node's own.
  std::string launch_file;
  ASSERT_TRUE(ros::param::get("~launch_file", launch_file));
  const Ended launched = run("cd " + folder() + " && roslaunch '" + launch_file +
                             "' bag:=session.bag to:=again.bag cloud_rate:=60 cloud_stride:=2");
  EXPECT_NE(launched.said.find("the same"), std::string::npos) << launched.said;
  const auto before = counts(bag), after = counts(folder() + "/again.bag");
  EXPECT_EQ(before.count("/simulator/tissue/points"), 0u);
  const int frames = after.at("/simulator/inputs");
  EXPECT_EQ(frames, before.at("/simulator/inputs"));
  EXPECT_EQ(after.at("/simulator/state"), frames);
  EXPECT_EQ(after.at("/simulator/tissue/points"), frames);
  EXPECT_GT(after.at("/simulator/probe/spatial/measured_cf"), 30);
  const Ended again = replay(folder() + "/again.bag");
  EXPECT_EQ(again.code, 0) << again.said;

  const Ended refused = replay(bag + " --to " + folder() + "/again.bag");
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.said.find("exists already"), std::string::npos) << refused.said;
}

template <class Service>
typename Service::Response with_path(const std::string& service, const std::string& path) {
  typename Service::Request request;
  request.path = path;
  return call<Service>(service, request);
}

TEST(ReplayNode, ARunGoesOnFromAStateThatWasSaved) {
  LoadScene::Request scene;  // the test's own
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", scene.path));
  pause(true);
  ASSERT_TRUE(call<LoadScene>("load_scene", scene).success);
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.connected(); }));
  Arm scalpel("scalpel");
  scalpel.send(blade_pose(0.001, -0.025, -0.004));
  const auto at = [&](std::int64_t frame) {
    EXPECT_TRUE(wait_until([&] { return state.last()->frame == frame; })) << frame;
    return state.last()->checksum;
  };
  step(5);
  EXPECT_TRUE(call<Cut>("cut", plane_cut(-0.009)).success);
  const auto saved = with_path<SaveState>("save_state", "middle");
  ASSERT_TRUE(saved.success) << saved.message;
  EXPECT_EQ(saved.frame, 6);
  EXPECT_EQ(saved.message, folder() + "/middle.state");
  EXPECT_FALSE(with_path<SaveState>("save_state", "middle").success) << "nothing is overwritten";

  start("from_the_middle");
  step(7);
  const std::string first = at(13);
  const auto restored = with_path<RestoreState>("restore_state", "middle.state");
  ASSERT_TRUE(restored.success) << restored.message;
  EXPECT_EQ(restored.frame, 6);
  EXPECT_NEAR(restored.time, 0.1, 1e-9);
  at(6);
  step(7);
  EXPECT_EQ(at(13), first) << "the same bits";
  EXPECT_TRUE(call<Cut>("cut", plane_cut(0.006)).success);  // a branch
  step(3);
  ASSERT_TRUE(trigger("stop_recording").success);
  const Ended again = replay(folder() + "/from_the_middle.bag");  // another process
  EXPECT_EQ(again.code, 0) << again.said;
  EXPECT_NE(again.said.find("of 2 runs"), std::string::npos) << again.said;
  EXPECT_EQ(again.said.find("left out"), std::string::npos) << again.said;

  const auto refused = [&](const std::string& path, const std::string& reason) {
    const auto reply = with_path<RestoreState>("restore_state", path);
    EXPECT_FALSE(reply.success) << path;
    EXPECT_NE(reply.message.find(reason), std::string::npos) << reply.message;
  };
  refused("nowhere", "no file");
  refused("../middle", "..");
  refused(folder() + "/middle.state", "absolute");
  fs::copy(folder() + "/middle.state", folder() + "/short.state");
  fs::resize_file(folder() + "/short.state", fs::file_size(folder() + "/short.state") / 2);
  refused("short", "cut short");
  { std::ofstream(folder() + "/other.state") << "something else"; }
  refused("other", "no state");
  LoadScene::Request other;
  other.yaml = "bodies: [{shape: box}]";
  ASSERT_TRUE(call<LoadScene>("load_scene", other).success);
  refused("middle", "another scene");
  EXPECT_TRUE(step(1).success) << "the present run goes on";
}

// What an instrument did when the state was saved it does again: jaws hold what they held, and a
// blade sweeps its way from where it was.
TEST(ReplayNode, InstrumentsGoOnFromAStateAsTheyDidBefore) {
  LoadScene::Request scene;
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", scene.path));
  pause(true);
  ASSERT_TRUE(call<LoadScene>("load_scene", scene).success);
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.connected(); }));
  Arm grasper("grasper"), scalpel("scalpel");
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/grasper/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  const auto go = [&](int from, int to) {
    for (int i = from; i < to; ++i) {
      grasper.send({Vec3(0.012, 0, 0.012 + 0.0001 * std::max(0, i - 20)), Quat(0, 1, 0, 0)});
      scalpel.send(blade_pose(0.001, -0.03 + 0.001 * i, -0.004));
      sensor_msgs::JointState jaw;
      jaw.header.stamp = ros::Time::now();
      jaw.position = {std::max(0.0, 1.2 - 0.08 * i)};
      jaws.publish(jaw);
      ros::WallDuration(0.03).sleep();
      ASSERT_TRUE(step(1).success);
    }
    ASSERT_TRUE(wait_until([&] { return state.last()->frame == to; }));
  };
  go(0, 30);
  ASSERT_TRUE(with_path<SaveState>("save_state", "gripping").success);
  go(30, 40);
  const std::string first = state.last()->checksum;
  ASSERT_TRUE(with_path<RestoreState>("restore_state", "gripping").success);
  ASSERT_TRUE(wait_until([&] { return state.last()->frame == 30; }));
  go(30, 40);
  EXPECT_EQ(state.last()->checksum, first);
}

TEST(ReplayNode, EndsWithACodeThatAScriptCanUse) {
  // A bag whose 3rd cut is a tenth of a millimetre beside what was cut.
  const std::string path = folder() + "/session.bag", changed = folder() + "/changed.bag";
  {
    rosbag::Bag from(path, rosbag::bagmode::Read), to(changed, rosbag::bagmode::Write);
    for (const rosbag::MessageInstance& m : rosbag::View(from)) {
      const auto input = m.instantiate<FrameInputMessage>();
      if (input && !input->cuts.empty()) {
        input->cuts[0].poses[0].position.x += 3e-3;
        to.write(m.getTopic(), m.getTime(), input);
      } else {
        to.write(m.getTopic(), m.getTime(), m);
      }
    }
  }
  const Ended differs = replay(changed);
  EXPECT_EQ(differs.code, 1) << differs.said;
  EXPECT_NE(differs.said.find("first difference: frame "), std::string::npos) << differs.said;
  EXPECT_NE(differs.said.find("checksum is "), std::string::npos) << differs.said;

  EXPECT_EQ(replay(folder() + "/nowhere.bag").code, 2);
  EXPECT_EQ(replay("").code, 2);
  EXPECT_EQ(replay(path + " --device abacus").code, 2);
  EXPECT_EQ(replay(path + " --node /other").code, 2);
  { std::ofstream(folder() + "/broken.bag") << "no bag"; }
  EXPECT_EQ(replay(folder() + "/broken.bag").code, 2);
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("replay_test")
