// Position-based dynamics end to end: a scalpel's poses cut it, pieces are said, the surface is
// shown, a bag holds the frames, a reset makes it whole again.
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/PointCloud2.h>
#include <tissue_sim/StartRecording.h>
#include <visualization_msgs/Marker.h>

#include <cmath>
#include <filesystem>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

constexpr double kVolume = 16e-6;  // of the slab [m^3]

class PbdCut : public testing::Test {
 protected:
  void SetUp() override {
    pause(true);
    trigger("reset");
    step(1);
  }
  std::size_t points() {
    step(1);
    const auto cloud = clouds_.next();
    return cloud ? cloud->width : 0;
  }
  FragmentArray fragments() {
    step(1);
    const auto m = fragments_.next();
    return m ? *m : FragmentArray();
  }
  void expect_halves() {
    const FragmentArray pieces = fragments();
    ASSERT_EQ(pieces.fragments.size(), 2u);
    const TissueFragment &held = pieces.fragments[0], &loose = pieces.fragments[1];
    EXPECT_FALSE(held.loose);
    EXPECT_TRUE(loose.loose);
    EXPECT_EQ(loose.parent, held.id);
    EXPECT_NEAR(held.volume, kVolume / 2, 0.03 * kVolume);
    EXPECT_NEAR(held.volume + loose.volume, kVolume, 0.01 * kVolume);
    EXPECT_LT(held.centroid.x, loose.centroid.x);
  }

  Topic<sensor_msgs::PointCloud2> clouds_{"/simulator/tissue/points"};
  Topic<FragmentArray> fragments_{"/simulator/fragments"};
};

TEST_F(PbdCut, AScalpelsPosesCutItInTwoAndAResetMakesItWhole) {
  const std::size_t whole = points();
  ASSERT_GT(whole, 50u);
  Topic<visualization_msgs::Marker> surface("/simulator/surface");
  step(1);
  const auto shown = surface.next();
  ASSERT_TRUE(shown);
  EXPECT_EQ(shown->type, visualization_msgs::Marker::TRIANGLE_LIST);
  EXPECT_GT(shown->points.size(), 300u);

  Arm scalpel("scalpel");
  const Pose from = blade_pose(0.0007, -0.025, -0.004), to = blade_pose(0.0007, 0.025, -0.004);
  pause(false);
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  ASSERT_TRUE(wait_until([&] {  // it must be there before it moves on
    scalpel.send(from);
    ros::WallDuration(0.02).sleep();
    const auto m = inputs.last();
    return m && m->tools[0].present &&
           (from_message(m->tools[0].begin).position - from.position).norm() < 1e-9;
  }));
  scalpel.sweep(from, to, 1.0);
  Topic<SimulationState> state("/simulator/state");
  EXPECT_TRUE(wait_until([&] { return state.count() > 0 && state.last()->fragments == 2; }));
  pause(true);
  expect_halves();
  EXPECT_GT(points(), whole) << "walls of the wound have vertices of their own";

  ASSERT_TRUE(trigger("reset").success);
  EXPECT_EQ(fragments().fragments.size(), 1u);
  EXPECT_EQ(points(), whole);
}

TEST_F(PbdCut, AServicesPathCutsItInTwo) {
  const Cut::Response reply = call<Cut>("cut", plane_cut(0.0007));
  ASSERT_TRUE(reply.success) << reply.message;
  EXPECT_GT(reply.points_separated, 10);
  ASSERT_EQ(reply.new_fragments.size(), 1u);
  expect_halves();
}

TEST_F(PbdCut, ABagHoldsTheCut) {
  std::string folder;
  ASSERT_TRUE(ros::param::get("/simulator/recording_folder", folder));
  StartRecording::Request request;
  request.path = "pbd";
  const auto started = call<StartRecording>("start_recording", request);
  ASSERT_TRUE(started.success) << started.message;
  step(3);
  ASSERT_TRUE(call<Cut>("cut", plane_cut(0.0007)).success);
  step(3);
  const auto stopped = trigger("stop_recording");
  ASSERT_TRUE(stopped.success) << stopped.message;
  int frames = 0, cuts = 0;
  std::size_t pieces = 0;
  {
    rosbag::Bag bag(folder + "/pbd.bag", rosbag::bagmode::Read);
    for (const rosbag::MessageInstance& m : rosbag::View(bag)) {
      if (const auto input = m.instantiate<FrameInputMessage>()) {
        ++frames;
        cuts += static_cast<int>(input->cuts.size());
      }
      if (const auto said = m.instantiate<FragmentArray>()) pieces = said->fragments.size();
    }
  }
  EXPECT_GE(frames, 6);
  EXPECT_EQ(cuts, 1);
  EXPECT_EQ(pieces, 2u);
  if (folder.find("/tmp/tissue_sim_recording_") == 0) fs::remove_all(folder);
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("pbd_cut_test")
