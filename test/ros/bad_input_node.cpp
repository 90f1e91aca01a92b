// What comes in wrong: poses are refused and counted while the simulation goes on; a node that
// cannot start says why in one line and exits non-zero.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <sys/wait.h>
#include <tissue_sim/LoadScene.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class Poses : public testing::Test {
 protected:
  static Pose at(double x, double z = 0.1) { return {Vec3(x, 0, z), Quat(0, 1, 0, 0)}; }

  void SetUp() override {
    pause(false);
    trigger("reset");
    ASSERT_TRUE(wait_until([&] {
      probe_.send(home_);
      ros::WallDuration(0.02).sleep();
      return is_at(home_);
    }));
  }
  bool is_at(const Pose& pose) {
    const auto m = inputs_.next();
    return m && m->tools[1].present &&
           (from_message(m->tools[1].end).position - pose.position).norm() < 1e-9;
  }
  // How many were refused for this reason, by diagnostics.
  int refused(const std::string& reason) {
    const auto m = diagnostics_.next();
    for (const auto& status : m ? m->status : diagnostic_msgs::DiagnosticArray().status) {
      for (const auto& value : status.values) {
        if (value.key == "probe: " + reason) return std::stoi(value.value);
      }
    }
    return -1;
  }
  // Sends what `send` sends three times; it is counted, moves nothing and stops nothing.
  void expect_refused(const std::string& reason, const std::function<void()>& send) {
    const int before = refused(reason);
    ASSERT_GE(before, 0) << reason;
    const std::int64_t frame = inputs_.last()->frame;
    for (int i = 0; i < 3; ++i) send();
    EXPECT_TRUE(wait_until([&] { return refused(reason) == before + 3; }))
        << reason << " " << refused(reason) << " before " << before;
    EXPECT_TRUE(is_at(home_)) << reason;
    EXPECT_TRUE(wait_until([&] { return inputs_.last()->frame > frame + 3; })) << reason;
    probe_.send(home_);
    ros::WallDuration(0.1).sleep();
  }

  const Pose home_ = at(0.1);
  Topic<FrameInputMessage> inputs_{"/simulator/inputs"};
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics_{"/diagnostics"};
  Arm probe_{"probe"};
};

TEST_F(Poses, NotFiniteIsRefused) {
  expect_refused("poses refused, not finite", [&] { probe_.send(at(kNan)); });
  expect_refused("poses refused, not finite", [&] {
    probe_.send({home_.position, Quat(kNan, 0, 0, 0)});
  });
}

TEST_F(Poses, QuaternionThatIsNoRotationIsRefused) {
  expect_refused("poses refused, no rotation", [&] {
    probe_.send({home_.position, Quat(0, 0, 0, 0)});
  });
  expect_refused("poses refused, no rotation", [&] {
    probe_.send({home_.position, Quat(1, 1, 1, 1)});
  });
}

TEST_F(Poses, OlderThanTheLastIsRefused) {
  const ros::Time old = ros::Time::now() - ros::Duration(5);
  expect_refused("poses refused, older than the last", [&] { probe_.send(at(0.11), "", old); });
}

TEST_F(Poses, UnknownFrameIsRefused) {
  expect_refused("poses refused, unknown frame", [&] { probe_.send(at(0.11), "nowhere"); });
}

TEST_F(Poses, JumpIsRefused) {
  expect_refused("poses refused, jump", [&] { probe_.send(at(90.0)); });
  expect_refused("poses refused, jump", [&] {
    probe_.send(home_);
    probe_.send({home_.position, Quat(1, 0, 0, 0)});  // half a turn at once
  });
}

TEST_F(Poses, JawThatIsNotFiniteIsRefused) {
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/probe/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  expect_refused("jaw angles refused", [&] {
    sensor_msgs::JointState m;
    m.position = {kNan};
    jaws.publish(m);
  });
  expect_refused("jaw angles refused", [&] { jaws.publish(sensor_msgs::JointState()); });
}

// The message of a part of the node in diagnostics.
std::string said(const Topic<diagnostic_msgs::DiagnosticArray>& diagnostics,
                 const std::string& part) {
  const auto m = diagnostics.next();
  for (const auto& s : m ? m->status : diagnostic_msgs::DiagnosticArray().status) {
    if (s.name == "simulator: " + part) return (s.level == s.OK ? "OK: " : "WARN: ") + s.message;
  }
  return "";
}

TEST_F(Poses, DiagnosticsNamesTheTopicWhereNoneEverCame) {
  const std::string text = said(diagnostics_, "tools");
  EXPECT_EQ(text.find("WARN: "), 0u) << text;
  EXPECT_NE(text.find("no pose ever came on /simulator/needle/measured_cp (0 publishers)"),
            std::string::npos)
      << text;
  EXPECT_EQ(text.find("probe:"), std::string::npos) << "that one is driven; " << text;
}

TEST_F(Poses, DiagnosticsSaysThatAPublisherIsGone) {
  ros::WallDuration(2.5).sleep();
  EXPECT_TRUE(wait_until(
      [&] { return said(diagnostics_, "tools").find("probe: no pose on") != std::string::npos; }));
}

TEST_F(Poses, DiagnosticsSaysThatPosesAreInMillimetres) {
  EXPECT_TRUE(wait_until([&] {
    probe_.send(at(10.0, 72.0));
    ros::WallDuration(0.02).sleep();
    return is_at(at(10.0, 72.0));
  }));
  EXPECT_TRUE(wait_until([&] {
    probe_.send(at(10.0, 72.0));
    const std::string text = said(diagnostics_, "tools");
    return text.find("from all tissue; positions divided by 1000") != std::string::npos;
  }));
}

TEST_F(Poses, AStampThatStaysTheSameIsBelieved) {
  const ros::Time stamp = ros::Time::now() - ros::Duration(5);
  const Pose away = at(0.12);
  EXPECT_TRUE(wait_until(
      [&] {
        probe_.send(away, "", stamp);
        ros::WallDuration(0.02).sleep();
        return is_at(away);
      },
      3));
}

TEST_F(Poses, RoundedQuaternionsAreNormalised) {
  const int before = refused("poses refused, no rotation");
  const Pose away{at(0.13).position, Quat(0, 0.99, 0, 0)};
  EXPECT_TRUE(wait_until(
      [&] {
        probe_.send(away);
        ros::WallDuration(0.02).sleep();
        return is_at(away);
      },
      3));
  EXPECT_NEAR(from_message(inputs_.last()->tools[1].end).orientation.norm(), 1, 1e-9);
  EXPECT_EQ(refused("poses refused, no rotation"), before);
}

TEST_F(Poses, JawInDegreesIsRefused) {
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/probe/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  expect_refused("jaw angles refused", [&] {
    sensor_msgs::JointState m;
    m.position = {60};
    jaws.publish(m);
  });
}

TEST_F(Poses, AnArmThatStaysAtItsNewPlaceIsPlacedThereWithoutSweeping) {
  const Pose away = at(40.0);
  for (int i = 0; i < 30 && !is_at(away); ++i) {
    probe_.send(away);
    ros::WallDuration(0.01).sleep();
  }
  ASSERT_TRUE(is_at(away));
  double longest = 0;
  for (const auto& m : inputs_.all()) {
    if (!m->tools[1].present) continue;
    longest = std::max(
        longest,
        (from_message(m->tools[1].end).position - from_message(m->tools[1].begin).position).norm());
  }
  EXPECT_LT(longest, 1.0) << "it never swept there";
  EXPECT_EQ(refused("placed anew") > 0, true);
}

TEST_F(Poses, MovingDuringAPauseSweepsNothing) {
  pause(true);
  for (int i = 1; i <= 20; ++i) {  // 0.2 m, slowly: each pose is fine
    probe_.send(at(0.1 + 0.01 * i));
    ros::WallDuration(0.01).sleep();
  }
  pause(false);
  EXPECT_TRUE(wait_until([&] { return is_at(at(0.3)); }));
  for (const auto& m : inputs_.all()) {
    if (!m->tools[1].present) continue;
    ASSERT_LT(
        (from_message(m->tools[1].end).position - from_message(m->tools[1].begin).position).norm(),
        0.09);  // 5 m/s for a frame
  }
}

TEST(BlowUp, IsSaidStandsStillAndNeverGivesNan) {
  Topic<SimulationState> state("/simulator/state");
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  std::string slab;
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", slab));
  pause(false);
  LoadScene::Request fall;  // for ever, until it is faster than anything can be
  fall.yaml =
      "{cell_size: 0.005, gravity: [0, 0, -1000], ground: {enabled: false}, bodies: [{shape: box, "
      "size: [0.04, 0.02, 0.02]}]}";
  ASSERT_TRUE(call<LoadScene>("load_scene", fall).success);
  ASSERT_TRUE(wait_until([&] { return state.count() > 0 && state.last()->blew_up; }));
  const std::int64_t frame = state.last()->frame;
  EXPECT_LT(frame, 60);
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(state.last()->frame, frame);
  const auto refused = [](bool success, const std::string& message) {
    EXPECT_FALSE(success);
    EXPECT_NE(message.find("blew up"), std::string::npos) << message;
  };
  const auto running = pause(false);
  refused(running.success, running.message);
  const auto cut = call<Cut>("cut", plane_cut(0));
  refused(cut.success, cut.message);
  EXPECT_TRUE(wait_until([&] {
    for (const auto& m : diagnostics.all()) {
      for (const auto& s : m->status) {
        if (s.name == "simulator: simulation" && s.level == s.ERROR &&
            s.message.find("blew up") != std::string::npos) {
          return true;
        }
      }
    }
    return false;
  }));
  for (const auto& c : clouds.all()) {
    for (std::size_t i = 0; i + sizeof(Point) <= c->data.size(); i += sizeof(Point)) {
      Point p;
      std::memcpy(&p, &c->data[i], sizeof p);
      ASSERT_TRUE(std::isfinite(p.x) && std::isfinite(p.z) && std::isfinite(p.stress));
    }
  }
  EXPECT_TRUE(trigger("reset").success);
  EXPECT_TRUE(wait_until([&] { return !state.last()->blew_up && state.last()->frame > 0; }));
  LoadScene::Request back;
  back.path = slab;
  EXPECT_TRUE(call<LoadScene>("load_scene", back).success);
}

struct Ended {
  int status;
  std::string output;
};

// Runs a node that should end by itself, or until `seconds` have passed; it lies where this test
// does.
Ended run(const std::string& arguments, int seconds = 20) {
  const std::string node =
      (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "simulator_node").string();
  const std::string command = "timeout -s INT " + std::to_string(seconds) + " '" + node +
                              "' __name:=broken " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  Ended ended{-1, ""};
  char part[256];
  while (pipe && fgets(part, sizeof part, pipe)) ended.output += part;
  const int status = pipe ? pclose(pipe) : -1;
  ended.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return ended;
}

void expect_cannot_start(const std::string& arguments, const std::string& reason) {
  const Ended ended = run(arguments);
  EXPECT_EQ(ended.status, 1) << ended.output;
  EXPECT_NE(ended.output.find("cannot start: "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find(reason), std::string::npos) << ended.output;
  EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
  ros::param::del("/broken");  // the master keeps what a command line sets
}

TEST(Start, WithoutASceneItSaysWhatToSet) { expect_cannot_start("", "there is no scene"); }

TEST(Start, APathGivenAsTheSceneIsNamed) {
  expect_cannot_start("_scene:=/nowhere.yaml", "for a path set ~scene_file");
}

TEST(Start, BadScenesAreRefusedWithTheField) {
  expect_cannot_start("'_scene:={bodies: [{shape: box, size: [0.04, -1, 0.02]}]}'",
                      "bodies[0].size is [0.04, -1, 0.02]");
  expect_cannot_start("'_scene:={cell_sice: 0.005, bodies: [{shape: box}]}'", "cell_sice");
  expect_cannot_start("_scene_file:=/nowhere.yaml", "/nowhere.yaml");
  expect_cannot_start("'_scene:={bodies: [{shape: mesh, mesh: /nowhere.stl}]}'", "/nowhere.stl");
}

TEST(Start, BadParametersAreRefusedWithTheirName) {
  const std::string scene = "'_scene:={cell_size: 0.005, bodies: [{shape: box}]}' ";
  expect_cannot_start(scene + "_cloud_rate:=fast", "~cloud_rate is \"fast\"");
  expect_cannot_start(scene + "_cloud_stride:=0", "~cloud_stride is 0");
  expect_cannot_start(scene + "_time:=sundial",
                      "~time is \"sundial\": must be wall, ros or lockstep");
  expect_cannot_start(scene + "_time:=ros _publish_clock:=true", "must be wall or lockstep");
  expect_cannot_start(scene + "_paused:=2", "~paused is 2");
  expect_cannot_start(scene + "_scene_file:=/also.yaml", "both set");
  expect_cannot_start(scene + "_tools/probe/interpolate:=cubic",
                      "~tools/probe/interpolate is \"cubic\": must be none or linear");
  expect_cannot_start(scene + "_mesh:=/nowhere.obj", "/nowhere.obj");
}

TEST(Start, WithoutAClockARecordingWaitsAndTheNextRunDoesNotInheritIt) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / ("no_clock_" + std::to_string(getpid()));
  ros::param::set("/use_sim_time", true);
  const Ended ended =
      run("'_scene:={cell_size: 0.005, bodies: [{shape: box}]}' _record:=true "
          "_recording_folder:=" +
              folder.string(),
          6);
  ros::param::del("/use_sim_time");
  EXPECT_NE(ended.output.find("the recording waits"), std::string::npos) << ended.output;
  EXPECT_TRUE(!fs::exists(folder) || fs::is_empty(folder)) << "nothing of 1970";
  EXPECT_FALSE(ros::param::has("/broken/record"));
  fs::remove_all(folder);
  ros::param::del("/broken");
}

TEST(Start, BadTreesOfParametersAreRefusedLikeYaml) {
  ros::NodeHandle node;
  node.setParam("/broken/scene/cell_size", 0.005);
  XmlRpc::XmlRpcValue body, size;
  size[0] = 0.04, size[1] = 0.02, size[2] = std::string("wide");
  body["shape"] = std::string("box");
  body["size"] = size;
  XmlRpc::XmlRpcValue bodies;
  bodies[0] = body;
  node.setParam("/broken/scene/bodies", bodies);
  expect_cannot_start("", "bodies[0].size");
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("bad_input_test")
