// Markers by which a hand moves the tools: what RViz sends when one is dragged or its menu is used.
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>
#include <visualization_msgs/InteractiveMarkerFeedback.h>
#include <visualization_msgs/InteractiveMarkerInit.h>

#include <algorithm>
#include <limits>
#include <set>
#include <string>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

using visualization_msgs::InteractiveMarker;
using visualization_msgs::InteractiveMarkerControl;
using visualization_msgs::InteractiveMarkerFeedback;
using visualization_msgs::InteractiveMarkerInit;

class Play : public testing::Test {
 protected:
  Play()
      : shown("/play_marker/update_full"), inputs("/simulator/inputs"), state("/simulator/state") {}

  void SetUp() override {
    feedback_ = node_.advertise<InteractiveMarkerFeedback>("/play_marker/feedback", 10);
    ASSERT_TRUE(wait_until([&] { return feedback_.getNumSubscribers() > 0; }));
    ASSERT_TRUE(wait_until([&] { return shown.last() && shown.last()->markers.size() == 5; }));
    ASSERT_TRUE(wait_until([&] { return tool("scalpel").present && tool("grasper").present; }));
  }

  const InteractiveMarker& marker(const std::string& name) {
    const auto& all = shown.last()->markers;
    return *std::find_if(all.begin(), all.end(), [&](const auto& m) { return m.name == name; });
  }
  InstrumentMotion tool(const std::string& name) {
    for (const auto& tool : inputs.last()->tools) {
      if (tool.name == name) return tool;
    }
    return {};
  }
  void send(const std::string& name, std::uint8_t event, const Pose& pose, unsigned entry = 0) {
    InteractiveMarkerFeedback m;
    m.client_id = "test";
    m.marker_name = name;
    m.control_name = "grip";
    m.event_type = event;
    m.menu_entry_id = entry;
    m.pose = to_pose(pose);
    m.header.frame_id = "world";
    feedback_.publish(m);
  }
  void drag(const std::string& name, const Pose& pose) {
    send(name, InteractiveMarkerFeedback::POSE_UPDATE, pose);
  }
  bool arrives(const std::string& name, const Pose& pose) {
    return wait_until(
        [&] { return (from_message(tool(name).end).position - pose.position).norm() < 1e-6; });
  }
  void choose(const std::string& name, const std::string& title) {
    for (const auto& entry : marker(name).menu_entries) {
      if (entry.title == title) {
        return send(name, InteractiveMarkerFeedback::MENU_SELECT, {}, entry.id);
      }
    }
    ADD_FAILURE() << name << " has no entry " << title;
  }

  ros::NodeHandle node_;
  ros::Publisher feedback_;
  Topic<InteractiveMarkerInit> shown;
  Topic<FrameInputMessage> inputs;
  Topic<SimulationState> state;
};

TEST_F(Play, EachToolHasAMarkerOfSixDegreesOfFreedom) {
  for (const auto& m : shown.last()->markers) {
    int moves = 0, turns = 0;
    for (const auto& control : m.controls) {
      moves += control.interaction_mode == InteractiveMarkerControl::MOVE_AXIS;
      turns += control.interaction_mode == InteractiveMarkerControl::ROTATE_AXIS;
    }
    EXPECT_EQ(moves, 3) << m.name;
    EXPECT_EQ(turns, 3) << m.name;
    std::set<std::string> titles;
    for (const auto& entry : m.menu_entries) titles.insert(entry.title);
    EXPECT_EQ(titles.count("Close the jaws"), m.name == "grasper" ? 1u : 0u) << m.name;
    EXPECT_EQ(titles.count("Start recording"), 1u) << m.name;
  }
}

TEST_F(Play, AToolFollowsItsMarkerAtAnArmsSpeed) {
  const Pose start = from_message(tool("grasper").end);
  const Pose goal{start.position + Vec3(0.06, 0.02, 0.03), start.orientation};
  const std::size_t before = inputs.count();
  drag("grasper", goal);
  EXPECT_TRUE(arrives("grasper", goal));
  const auto all = inputs.all();
  for (std::size_t i = before; i < all.size(); ++i) {
    for (const auto& t : all[i]->tools) {
      const double step = (from_message(t.end).position - from_message(t.begin).position).norm();
      ASSERT_LT(step, 0.05) << "no jumps";
    }
  }
}

TEST_F(Play, NonsenseChangesNothing) {
  ros::Publisher scene = node_.advertise<std_msgs::String>("/simulator/scene", 10);
  ASSERT_TRUE(wait_until([&] { return scene.getNumSubscribers() > 0; }));
  std_msgs::String text;
  for (const std::string& nonsense : {std::string("tools"), std::string("tools: [{name: [1]}]"),
                                      std::string("{"), std::string(100000, '[')}) {
    text.data = nonsense;
    scene.publish(text);
  }
  const Pose start = from_message(tool("grasper").end);
  const double infinite = std::numeric_limits<double>::infinity();
  drag("grasper", {start.position, Quat(infinite, 0, 0, 0)});
  drag("grasper", {Vec3(1e300, 0, 0), start.orientation});
  const Pose goal{start.position + Vec3(0, 0, 0.01), start.orientation};
  drag("grasper", goal);
  EXPECT_TRUE(arrives("grasper", goal));
  drag("grasper", start);
  EXPECT_TRUE(arrives("grasper", start));
}

TEST_F(Play, TheMenuMovesJaws) {
  choose("grasper", "Close the jaws");
  EXPECT_TRUE(wait_until([&] { return tool("grasper").jaw_end < 1e-6; }));
  choose("grasper", "Open the jaws");
  EXPECT_TRUE(wait_until([&] { return std::abs(tool("grasper").jaw_end - 0.6) < 1e-6; }));
}

TEST_F(Play, ADraggedScalpelCutsAndTheMenuCutsAndResets) {
  EXPECT_EQ(state.last()->fragments, 1);
  const Pose beside = blade_pose(0.013, -0.06, -0.002), beyond = blade_pose(0.013, 0.06, -0.002);
  drag("scalpel", beside);
  ASSERT_TRUE(arrives("scalpel", beside));
  drag("scalpel", beyond);
  ASSERT_TRUE(arrives("scalpel", beyond));
  EXPECT_TRUE(wait_until([&] { return state.last()->fragments == 2; }));
  choose("scalpel", "Reset the tissue");
  EXPECT_TRUE(wait_until([&] { return state.last()->fragments == 1; }));
  const Pose above = blade_pose(-0.011, 0, 0.04);
  drag("scalpel", {beyond.position + Vec3(0, 0, 0.1), beyond.orientation});
  ASSERT_TRUE(arrives("scalpel", {beyond.position + Vec3(0, 0, 0.1), beyond.orientation}));
  drag("scalpel", above);
  ASSERT_TRUE(arrives("scalpel", above));
  choose("scalpel", "Cut here, in the blade's plane");
  EXPECT_TRUE(wait_until([&] { return state.last()->fragments == 2; }));
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("play_test")
