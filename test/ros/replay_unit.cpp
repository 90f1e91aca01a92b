// Bags are run again: all that a recording can hold comes out bit for bit, and what differs is
// found in the frame where it does.
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <std_msgs/String.h>

#include <filesystem>

#include "ros/conversions.h"
#include "ros/replay.h"

namespace tissue_sim {
namespace {

Scene slab() {
  Scene scene;
  scene.name = "slab";
  scene.cell_size = 0.005;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.02, 0.02);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.01);
  scene.tools.resize(3);
  scene.tools[0].name = "probe";
  scene.tools[1].name = "scalpel";
  scene.tools[1].type = ToolType::kScalpel;
  scene.tools[2].name = "grasper";
  scene.tools[2].type = ToolType::kGrasper;
  return scene;
}

BladePath plane(double x) {
  BladePath path;
  path.edge = {Vec3(0, 0, 0), Vec3(0, 0, -0.04)};
  const Quat down(0, 1, 0, 0);
  path.poses = {{Vec3(x, -0.03, -0.01), down}, {Vec3(x, 0.03, -0.01), down}};
  return path;
}

// Writes bags as the node does.
class Writer {
 public:
  explicit Writer(const std::string& path) : bag_(path, rosbag::bagmode::Write) {}

  void begin(const Scene& scene) {
    std_msgs::String text;
    text.data = scene_to_yaml(scene);
    write("scene", text);
    simulation = std::make_unique<Simulation>(scene);
    pieces_ = {};
  }
  // `change` makes the recorded message another than what happened.
  void frame(const std::function<void(FrameInputMessage&)>& change_input = {},
             const std::function<void(SimulationState&)>& change_state = {}) {
    write(simulation->advance_frame(), change_input, change_state);
  }
  void write(const FrameReport& report,
             const std::function<void(FrameInputMessage&)>& change_input = {},
             const std::function<void(SimulationState&)>& change_state = {}) {
    FrameInputMessage input = to_message(report.input, simulation->scene());
    if (change_input) change_input(input);
    write("inputs", input);
    pieces_.follow(simulation->tissue());
    SimulationState state = state_message(*simulation, report, {}, pieces_, true);
    if (change_state) change_state(state);
    write("state", state);
  }
  template <class M>
  void write(const std::string& name, const M& message) {
    now_ += ros::Duration(0.001);
    bag_.write("/simulator/" + name, now_, message);
  }
  void close() { bag_.close(); }

  std::unique_ptr<Simulation> simulation;

 private:
  rosbag::Bag bag_;
  PieceCount pieces_;
  ros::Time now_{100.0};
};

class ReplayTest : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/tissue_sim_replay_XXXXXX";
    folder_ = mkdtemp(name);
    path_ = folder_ + "/run.bag";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  ReplayReport replay(const std::function<void(Scene&)>& change = {}) {
    rosbag::Bag bag(path_, rosbag::bagmode::Read);
    return Replay({}, change).run(bag, recorded_topics(bag, ""));
  }
  void expect_refused(const std::string& reason) {
    try {
      replay();
      FAIL() << "was run";
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find(reason), std::string::npos) << e.what();
    }
  }

  std::string folder_, path_;
};

const Quat kDown(0, 1, 0, 0);

TEST_F(ReplayTest, AllThatARecordingCanHoldComesOutTheSame) {
  Writer w(path_);
  w.begin(slab());
  for (int i = 0; i < 12; ++i) {  // pressed, gripped, cut twice in a frame
    w.simulation->set_tool(0, {Vec3(0.012, 0, 0.027 - 0.001 * i), kDown});
    w.simulation->set_tool(2, {Vec3(-0.01, 0, 0.016), kDown}, 0.6 - 0.05 * i);
    if (i == 5) {
      w.simulation->cut(plane(0.001));
      w.simulation->cut(plane(-0.006));
    }
    if (i >= 6) w.simulation->set_tool(1, {Vec3(0.008, -0.03 + 0.008 * (i - 6), 0.005), kDown});
    w.frame();
  }
  AppliedInput input;  // placed elsewhere without moving there, and one that is lifted out
  input.tools.resize(3);
  input.tools[0].present = true;
  input.tools[0].begin = input.tools[0].end = {Vec3(-0.012, 0, 0.03), kDown};
  w.write(w.simulation->repeat_frame(input));
  EXPECT_GT(w.simulation->tissue().fragment_count(), 2);
  w.begin(slab());  // reset
  for (int i = 0; i < 3; ++i) w.frame();
  Scene other = slab();
  other.tools.resize(1);
  other.bodies[0].material = "fat";
  w.begin(other);
  w.simulation->set_tool(0, {Vec3(0, 0, 0.02), kDown});
  for (int i = 0; i < 3; ++i) w.frame();
  w.close();

  const ReplayReport r = replay();
  EXPECT_EQ(r.first, "");
  EXPECT_EQ(r.runs, 3);
  EXPECT_EQ(r.frames, 19);
  EXPECT_EQ(r.compared, 19);
  EXPECT_EQ(r.checksums, 19);
  EXPECT_EQ(r.left_out, 0);
}

TEST_F(ReplayTest, WhatDiffersIsSaidWithItsFrame) {
  Writer w(path_);
  w.begin(slab());
  for (int i = 0; i < 8; ++i) {
    w.frame({}, [&](SimulationState& s) {
      if (i == 3) s.elastic_energy *= 1 + 1e-15;
      if (i == 5) s.fragments = 7;
    });
  }
  w.close();
  const ReplayReport r = replay();
  EXPECT_EQ(r.differing, 2);
  EXPECT_EQ(r.first.find("frame 3: elastic energy is "), 0u) << r.first;
}

TEST_F(ReplayTest, AnotherForceIsFoundByTheChecksum) {
  Writer w(path_);
  w.begin(slab());
  for (int i = 0; i < 8; ++i) {  // what is recorded is a hair beside what was done
    w.simulation->set_tool(0, {Vec3(0.012, 0, 0.020 - 0.001 * i), kDown});
    w.frame([&](FrameInputMessage& m) {
      if (i == 4) m.tools[0].end.position.z += 1e-6;
      if (i == 5) m.tools[0].begin.position.z += 1e-6;
    });
  }
  w.close();
  const ReplayReport r = replay();
  EXPECT_EQ(r.first.find("frame 4: checksum is "), 0u) << r.first;
  EXPECT_EQ(r.differing, 4);
}

TEST_F(ReplayTest, WithAnotherSceneAllIsOther) {
  Writer w(path_);
  w.begin(slab());
  for (int i = 0; i < 3; ++i) w.frame();
  w.close();
  const ReplayReport r = replay([](Scene& scene) {  // gravity and damping are inputs
    Material stiffer = find_material(scene, scene.bodies[0].material);
    stiffer.young_modulus *= 1.1;
    scene.materials.push_back(stiffer);
  });
  EXPECT_EQ(r.differing, 3);
  EXPECT_EQ(r.first.find("frame 0: "), 0u) << r.first;
  EXPECT_EQ(replay([](Scene& scene) { scene.threads = 1; }).first, "");
}

TEST_F(ReplayTest, BagsThatCannotBeRunAreRefused) {
  {
    Writer w(path_);
    w.begin(slab());
    for (int i = 0; i < 3; ++i) w.simulation->advance_frame();  // before the recording
    w.frame();
    w.close();
    expect_refused("in the middle of a run");
  }
  {
    Writer w(path_);
    w.begin(slab());
    w.close();
    expect_refused("no inputs");
  }
  {
    Writer w(path_);
    w.simulation = std::make_unique<Simulation>(slab());
    w.frame();
    w.close();
    expect_refused("no /simulator/scene");
  }
  {
    Writer w(path_);
    w.begin(slab());
    w.frame();
    w.simulation->advance_frame();  // a frame is missing
    w.frame();
    w.close();
    EXPECT_EQ(replay().first.find("frame 2: it follows frame 0"), 0u) << replay().first;
  }
}

}  // namespace
}  // namespace tissue_sim
