// Bags: what is in them, message by message; that they can be run again; what names are refused.
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>
#include <tissue_sim/StartRecording.h>
#include <visualization_msgs/MarkerArray.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "simulator_client.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

StartRecording::Response start(const std::string& path,
                               const std::vector<std::string>& topics = {}) {
  StartRecording::Request request;
  request.path = path;
  request.topics = topics;
  return call<StartRecording>("start_recording", request);
}

template <class M>
std::vector<boost::shared_ptr<M>> read(const std::string& bag_path, const std::string& topic) {
  rosbag::Bag bag(bag_path, rosbag::bagmode::Read);
  std::vector<boost::shared_ptr<M>> messages;
  for (const rosbag::MessageInstance& m : rosbag::View(bag, rosbag::TopicQuery(topic))) {
    messages.push_back(m.instantiate<M>());
  }
  return messages;
}

// The bytes on the wire. roscpp numbers each publisher's messages, the bag's were never sent.
template <class M>
std::string bytes(M message) {
  message.header.seq = 0;
  const ros::SerializedMessage m = ros::serialization::serializeMessage(message);
  return std::string(reinterpret_cast<const char*>(m.buf.get()), m.num_bytes);
}

class Recording : public testing::Test {
 protected:
  void SetUp() override {
    pause(true);
    trigger("reset");
  }
  static std::string path(const std::string& name) { return folder() + "/" + name + ".bag"; }
  static std::string folder() {
    std::string folder;
    EXPECT_TRUE(ros::param::get("/simulator/recording_folder", folder));
    return folder;
  }
};

// Leaves nothing behind in /tmp.
class Cleanup : public testing::Environment {
  void TearDown() override {
    std::string folder;
    if (ros::param::get("/simulator/recording_folder", folder) &&
        folder.find("/tmp/tissue_sim_recording_") == 0) {
      fs::remove_all(folder);
    }
  }
};
testing::Environment* const kCleanup = testing::AddGlobalTestEnvironment(new Cleanup);

// Everything that was received is in the bag, and everything in the bag was received.
template <class M>
void expect_same(const std::vector<boost::shared_ptr<const M>>& received,
                 const std::vector<boost::shared_ptr<M>>& recorded, const char* topic) {
  ASSERT_EQ(received.size(), recorded.size()) << topic;
  for (std::size_t i = 0; i < received.size(); ++i) {
    ASSERT_EQ(bytes(*received[i]), bytes(*recorded[i])) << topic << ", message " << i;
  }
}

TEST_F(Recording, HoldsWhatWasPublishedMessageByMessage) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Topic<SimulationState> state("/simulator/state");
  Topic<FragmentArray> fragments("/simulator/fragments");
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  ASSERT_TRUE(wait_until([&] {
    return inputs.connected() && state.connected() && fragments.connected() && clouds.connected();
  }));
  step(1);  // all connections are up once this has come
  ASSERT_TRUE(wait_until([&] { return inputs.count() && clouds.count() && fragments.count(); }));
  const std::size_t inputs_before = inputs.count(), clouds_before = clouds.count();

  const StartRecording::Response reply = start("whole");
  ASSERT_TRUE(reply.success) << reply.message;
  EXPECT_TRUE(fs::exists(path("whole") + ".active"));
  EXPECT_FALSE(fs::exists(path("whole")));
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(step(2).frame, 3 + 2 * i);
    ASSERT_TRUE(
        wait_until([&] { return clouds.last()->header.stamp == state.last()->header.stamp; }));
  }
  ASSERT_TRUE(call<Cut>("cut", plane_cut(0.001)).success);
  ASSERT_TRUE(wait_until([&] { return inputs.last()->frame == 41; }));
  const std_srvs::Trigger::Response stopped = trigger("stop_recording");
  ASSERT_TRUE(stopped.success) << stopped.message;
  EXPECT_FALSE(fs::exists(path("whole") + ".active"));
  ASSERT_TRUE(fs::exists(path("whole")));

  auto received = inputs.all();
  received.erase(received.begin(), received.begin() + inputs_before);
  const auto recorded = read<FrameInputMessage>(path("whole"), "/simulator/inputs");
  expect_same(received, recorded, "inputs");
  for (std::size_t i = 0; i < recorded.size(); ++i) ASSERT_EQ(recorded[i]->frame, 1 + (int)i);
  EXPECT_EQ(recorded.back()->cuts.size(), 1u);

  // Between steps, those who listen are shown the state again; the bag has each frame once.
  const auto states = read<SimulationState>(path("whole"), "/simulator/state");
  ASSERT_EQ(states.size(), recorded.size());
  std::map<ros::Time, std::string> seen;
  for (const auto& m : state.all()) seen[m->header.stamp] = bytes(*m);
  for (const auto& m : states) ASSERT_EQ(seen[m->header.stamp], bytes(*m));

  seen.clear();
  for (const auto& m : clouds.all()) seen[m->header.stamp] = bytes(*m);
  const auto points = read<sensor_msgs::PointCloud2>(path("whole"), "/simulator/tissue/points");
  EXPECT_GE(points.size(), 21u);
  EXPECT_GE(clouds.count(), clouds_before + 21);
  for (const auto& m : points) ASSERT_EQ(seen[m->header.stamp], bytes(*m));
  seen.clear();
  for (const auto& m : fragments.all()) seen[m->header.stamp] = bytes(*m);
  const auto pieces = read<FragmentArray>(path("whole"), "/simulator/fragments");
  for (const auto& m : pieces) ASSERT_EQ(seen[m->header.stamp], bytes(*m));
  ASSERT_FALSE(pieces.empty());
  EXPECT_EQ(pieces.back()->fragments.size(), 2u);
}

TEST_F(Recording, IsCompressedAndKeepsTheSceneLatched) {
  ASSERT_TRUE(start("latched").success);
  step(3);
  ASSERT_TRUE(trigger("stop_recording").success);
  rosbag::Bag bag(path("latched"), rosbag::bagmode::Read);
  std::ifstream file(path("latched"), std::ios::binary);
  const std::string raw((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_NE(raw.find("compression=lz4"), std::string::npos);
  EXPECT_EQ(raw.find("compression=none"), std::string::npos);
  rosbag::View view(bag, rosbag::TopicQuery("/simulator/scene"));
  ASSERT_EQ(view.size(), 1u);
  ASSERT_EQ(view.getConnections().size(), 1u);
  EXPECT_EQ((*view.getConnections()[0]->header)["latching"], "1");
  EXPECT_EQ(scene_from_yaml(view.begin()->instantiate<std_msgs::String>()->data).name, "slab");
}

TEST_F(Recording, CloudsAreMadeWhenNobodyElseListens) {
  ASSERT_TRUE(start("alone").success);
  pause(false);
  ros::WallDuration(1.5).sleep();
  pause(true);
  ASSERT_TRUE(trigger("stop_recording").success);
  const auto inputs = read<FrameInputMessage>(path("alone"), "/simulator/inputs");
  const auto clouds = read<sensor_msgs::PointCloud2>(path("alone"), "/simulator/tissue/points");
  ASSERT_GT(inputs.size(), 20u);
  for (std::size_t i = 1; i < inputs.size(); ++i) {
    ASSERT_EQ(inputs[i]->frame, inputs[i - 1]->frame + 1) << "no frame is missing";
  }
  EXPECT_GT(clouds.size(), inputs.size() / 4);  // 30 of 60 Hz, or what the machine can
  for (const auto& c : clouds) ASSERT_EQ(c->width, 1024u);
  using visualization_msgs::MarkerArray;
  EXPECT_FALSE(read<MarkerArray>(path("alone"), "/simulator/markers").empty()) << "RViz's tools";
}

TEST_F(Recording, CanBeRunAgainBitForBit) {
  ASSERT_TRUE(start("again").success);
  trigger("reset");  // the run from its start
  Arm scalpel("scalpel"), probe("probe");
  pause(false);
  probe.sweep({Vec3(0.012, 0, 0.04), Quat(0, 1, 0, 0)}, {Vec3(0.012, 0, 0.017), Quat(0, 1, 0, 0)},
              0.5);
  scalpel.sweep(blade_pose(0.001, -0.025, -0.004), blade_pose(0.001, 0.01, -0.004), 0.5);
  EXPECT_TRUE(call<Cut>("cut", plane_cut(-0.009)).success);
  ros::WallDuration(0.3).sleep();
  pause(true);
  ASSERT_TRUE(trigger("stop_recording").success);

  std::string scene;
  std::vector<FrameInputMessage> inputs;
  std::map<std::int64_t, std::string> sums;
  rosbag::Bag bag(path("again"), rosbag::bagmode::Read);
  for (const rosbag::MessageInstance& m : rosbag::View(bag)) {
    if (m.getTopic() == "/simulator/scene") {  // whatever came before belongs to the run before
      scene = m.instantiate<std_msgs::String>()->data;
      inputs.clear();
      sums.clear();
    } else if (m.getTopic() == "/simulator/inputs") {
      inputs.push_back(*m.instantiate<FrameInputMessage>());
    } else if (m.getTopic() == "/simulator/state") {
      const auto s = m.instantiate<SimulationState>();
      sums[s->frame] = s->checksum;
    }
  }
  ASSERT_GT(inputs.size(), 20u);
  ASSERT_EQ(sums.size(), inputs.size());
  EXPECT_EQ(inputs.front().frame, 0);
  bool moved = false, cut = false;
  Simulation simulation(scene_from_yaml(scene));
  for (const FrameInputMessage& input : inputs) {
    ASSERT_EQ(input.frame, simulation.frame());
    moved = moved || (input.tools[0].present && input.tools[1].present);
    cut = cut || !input.cuts.empty();
    simulation.repeat_frame(from_message(input));
    ASSERT_EQ(to_hex(simulation.tissue().checksum()), sums[simulation.frame()])
        << "frame " << simulation.frame();
  }
  EXPECT_TRUE(moved && cut);
}

TEST_F(Recording, OnlyTheTopicsThatAreAskedForAndWhatAReplayNeeds) {
  EXPECT_FALSE(start("topics", {"nonsense"}).success);
  ASSERT_TRUE(start("topics", {"state"}).success);
  step(3);
  ASSERT_TRUE(trigger("stop_recording").success);
  rosbag::Bag bag(path("topics"), rosbag::bagmode::Read);
  std::map<std::string, int> counts;
  for (const rosbag::MessageInstance& m : rosbag::View(bag)) ++counts[m.getTopic()];
  EXPECT_EQ(counts.size(), 3u);
  EXPECT_EQ(counts["/simulator/state"], 3);
  EXPECT_EQ(counts["/simulator/inputs"], 3);
  EXPECT_EQ(counts["/simulator/scene"], 1);
}

/// Made of points, it would make a recording of everything twice as large; asked for, it comes.
TEST_F(Recording, TheSurfaceOfPointsOnlyIfItIsAskedFor) {
  for (const bool asked : {false, true}) {
    const std::string name = asked ? "surface" : "all";
    ASSERT_TRUE(asked ? start(name, {"surface"}).success : start(name).success);
    step(3);
    ASSERT_TRUE(trigger("stop_recording").success);
    rosbag::Bag bag(path(name), rosbag::bagmode::Read);
    rosbag::View surfaces(bag, rosbag::TopicQuery("/simulator/surface"));
    EXPECT_EQ(surfaces.size() > 0, asked);
  }
}

TEST_F(Recording, NamesThatLeaveTheFolderOrExistAreRefused) {
  const auto refused = [](const std::string& name, const std::string& reason) {
    const StartRecording::Response reply = start(name);
    EXPECT_FALSE(reply.success) << name;
    EXPECT_NE(reply.message.find(reason), std::string::npos) << reply.message;
  };
  refused("/tmp/elsewhere", "absolute");
  refused("../elsewhere", "..");
  refused("a/../../elsewhere", "..");
  fs::create_directory_symlink("/tmp", folder() + "/way_out");
  refused("way_out/elsewhere", "through a link");
  EXPECT_FALSE(fs::exists("/tmp/elsewhere.bag"));
  EXPECT_FALSE(fs::exists("/tmp/elsewhere.bag.active"));
  ASSERT_TRUE(start("once").success);
  refused("twice", "already recording");
  ASSERT_TRUE(trigger("stop_recording").success);
  refused("once", "exists already");
  refused("once.bag", "exists already");
  const auto size = fs::file_size(path("once"));
  EXPECT_EQ(fs::file_size(path("once")), size);
  EXPECT_FALSE(trigger("stop_recording").success) << "nothing is being recorded";

  const StartRecording::Response named = start("");
  ASSERT_TRUE(named.success) << named.message;
  ASSERT_TRUE(trigger("stop_recording").success);
  const StartRecording::Response below = start("a/b/c");
  ASSERT_TRUE(below.success) << below.message;
  ASSERT_TRUE(trigger("stop_recording").success);
  EXPECT_TRUE(fs::exists(path("a/b/c")));
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("recording_test")
