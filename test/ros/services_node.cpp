// The services but for cuts and recordings; the nodelet; the instrument player.
#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>
#include <tissue_sim/LoadScene.h>
#include <tissue_sim/SaveSurface.h>
#include <visualization_msgs/Marker.h>

#include <cstdio>

#include "geometry/mesh.h"
#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr int kPoints = 8 * 4 * 4 * 8;  // of the slab: cells times points a cell

class Services : public testing::Test {
 protected:
  void SetUp() override {
    pause(false);
    trigger("reset");
  }
};

TEST_F(Services, PausedItStandsStillAndStepsByFrames) {
  EXPECT_FALSE(step(1).success) << "while running";
  ASSERT_TRUE(pause(true).success);
  Topic<SimulationState> state("/simulator/state");
  const auto before = state.next();
  ASSERT_TRUE(before);
  EXPECT_TRUE(before->paused);
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(state.last()->frame, before->frame);
  const Step::Response reply = step(7);
  EXPECT_TRUE(reply.success);
  EXPECT_EQ(reply.frame, before->frame + 7);
  EXPECT_NEAR(reply.time, reply.frame / 60.0, 1e-9);
  EXPECT_FALSE(step(0).success);
  EXPECT_FALSE(step(-3).success);
  EXPECT_TRUE(pause(false).success);
  EXPECT_TRUE(wait_until([&] { return state.last()->frame > reply.frame; }));
}

TEST_F(Services, StepsFromTheStartGiveTheSameBits) {
  std::vector<std::string> sums;
  pause(true);
  Topic<SimulationState> state("/simulator/state");
  for (int run = 0; run < 2; ++run) {
    trigger("reset");
    ASSERT_EQ(step(20).frame, 20);
    ASSERT_TRUE(wait_until([&] { return state.count() > 0 && state.last()->frame == 20; }));
    sums.push_back(state.last()->checksum);
  }
  EXPECT_EQ(sums[0], sums[1]);
}

TEST_F(Services, ResetStartsAtFrameZero) {
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.count() > 0 && state.last()->frame > 30; }));
  pause(true);
  Topic<std_msgs::String> scenes("/simulator/scene");
  ASSERT_TRUE(scenes.last());
  const std::size_t before = scenes.count();
  EXPECT_TRUE(trigger("reset").success);
  EXPECT_TRUE(wait_until([&] { return scenes.count() == before + 1; })) << "announced anew";
  EXPECT_EQ(step(1).frame, 1);
}

TEST_F(Services, LoadSceneTakesAnotherOneAndRefusesABadOne) {
  Topic<SimulationState> state("/simulator/state");
  LoadScene::Request bad;
  bad.yaml = "bodies: [{shape: box, size: [0.04, -1, 0.02]}]";
  LoadScene::Response reply = call<LoadScene>("load_scene", bad);
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.message.find("bodies[0].size"), std::string::npos) << reply.message;
  EXPECT_FALSE(call<LoadScene>("load_scene", {}).success) << "neither path nor text";
  LoadScene::Request missing;
  missing.path = "/nowhere/scene.yaml";
  EXPECT_FALSE(call<LoadScene>("load_scene", missing).success);
  ASSERT_TRUE(state.next());
  EXPECT_EQ(state.last()->particles, kPoints) << "the old one goes on";

  LoadScene::Request cube;
  cube.yaml =
      "{name: cube, cell_size: 0.005, bodies: [{shape: box, size: [0.02, 0.02, 0.02]}], tools: "
      "[{name: probe}]}";
  reply = call<LoadScene>("load_scene", cube);
  ASSERT_TRUE(reply.success) << reply.message;
  EXPECT_TRUE(wait_until([&] { return state.last()->particles == 4 * 4 * 4 * 8; }));
  Arm arm("probe");  // its topics are there again

  std::string path;
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", path));
  LoadScene::Request back;
  back.path = path;
  ASSERT_TRUE(call<LoadScene>("load_scene", back).success);
  EXPECT_TRUE(wait_until([&] { return state.last()->particles == kPoints; }));
}

/// What RViz is shown and what the file holds are one surface, of each method.
TEST_F(Services, SaveSurfaceWritesWhatIsShown) {
  Topic<visualization_msgs::Marker> surface("/simulator/surface");
  Topic<std_msgs::String> scenes("/simulator/scene");
  ASSERT_TRUE(scenes.last());
  LoadScene::Request before;
  before.yaml = scenes.last()->data;
  for (const std::string method : {"mpm", "mls", "pbd"}) {
    LoadScene::Request scene;
    scene.yaml = "method: " + method +
                 "\ncell_size: 0.005\ngravity: [0, 0, 0]\n"
                 "bodies: [{shape: box, size: [0.03, 0.02, 0.02], pose: {position: [0, 0, 0.05]}}]";
    ASSERT_TRUE(call<LoadScene>("load_scene", scene).success);
    ASSERT_TRUE(pause(true).success);
    std::size_t shown = 0;
    ASSERT_TRUE(wait_until([&] {
      const std::size_t count = surface.count();
      return step(1).success && wait_until([&] { return surface.count() > count; }, 1);
    })) << method;
    shown = surface.all().back()->points.size() / 3;
    SaveSurface::Request save;
    const auto stamp = ros::WallTime::now().toNSec();
    save.path = "surface_" + method + std::to_string(stamp);
    const SaveSurface::Response saved = call<SaveSurface>("save_surface", save);
    ASSERT_TRUE(saved.success) << saved.message;
    EXPECT_EQ(static_cast<std::size_t>(saved.triangles), shown) << method;
    TriangleMesh mesh = read_mesh(saved.message);
    EXPECT_EQ(mesh.triangles.size(), shown) << method;
    std::vector<std::string> notes;
    make_solid(mesh, notes);  // throws for a surface that is open
    EXPECT_NEAR(signed_volume(mesh), 0.03 * 0.02 * 0.02, 0.02 * 0.03 * 0.02 * 0.02) << method;
    EXPECT_FALSE(call<SaveSurface>("save_surface", save).success) << "nothing is overwritten";
    std::remove(saved.message.c_str());
  }
  SaveSurface::Request outside;
  outside.path = "../surface";
  EXPECT_FALSE(call<SaveSurface>("save_surface", outside).success);
  EXPECT_TRUE(call<LoadScene>("load_scene", before).success) << "for the other tests";
}

TEST(Nodelet, RunsTheSameSimulator) {
  Topic<SimulationState> state("/nodelet/state");
  const auto s = state.last(30);
  ASSERT_TRUE(s);
  EXPECT_EQ(s->particles, 4 * 2 * 2 * 8);  // its scene is a tree of parameters: see services.test
}

TEST(Player, PlaysAFileOfPoses) {
  Topic<geometry_msgs::PoseStamped> poses("/played/measured_cp");
  Topic<sensor_msgs::JointState> jaws("/played/jaw/measured_js");
  ASSERT_TRUE(wait_until(
      [&] { return poses.count() > 0 && poses.last()->pose.position.x > 0.2 - 1e-9; }, 30));
  const auto all = poses.all();
  EXPECT_GT(all.size(), 30u);  // 0.5 s at 100 Hz
  EXPECT_EQ(all[0]->header.frame_id, "arm_base");
  for (const auto& m : all) {  // x goes from 0.1 to 0.2 while z falls from 0.1 to 0
    ASSERT_NEAR(m->pose.position.x - 0.1, 0.1 - m->pose.position.z, 1e-9);
  }
  ASSERT_TRUE(jaws.last());
  EXPECT_NEAR(jaws.last()->position.at(0), 0.5, 1e-9);
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("services_test")
