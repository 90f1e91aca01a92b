// What a stranger on the ROS network can do to a node: after each of these it answers and goes on.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <tf2_msgs/TFMessage.h>
#include <tissue_sim/LoadScene.h>
#include <tissue_sim/RestoreState.h>
#include <tissue_sim/SaveState.h>
#include <tissue_sim/StartRecording.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "simulator_client.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

class Stranger : public testing::Test {
 protected:
  void SetUp() override {
    pause(false);
    ASSERT_TRUE(trigger("reset").success);
  }
  /// Each test leaves a node that goes on.
  void TearDown() override {
    const auto before = inputs_.next();
    ASSERT_TRUE(before);
    EXPECT_TRUE(wait_until([&] { return inputs_.last()->frame > before->frame + 3; }));
  }
  int refused(const std::string& reason) {
    const auto m = diagnostics_.next();
    for (const auto& status : m ? m->status : diagnostic_msgs::DiagnosticArray().status) {
      for (const auto& value : status.values) {
        if (value.key == "probe: poses refused, " + reason) return std::stoi(value.value);
      }
    }
    return -1;
  }
  static LoadScene::Response load(const std::string& path, const std::string& yaml = "") {
    LoadScene::Request request;
    request.path = path;
    request.yaml = yaml;
    return call<LoadScene>("load_scene", request);
  }
  static void expect_refused(const LoadScene::Response& reply, const std::string& reason) {
    EXPECT_FALSE(reply.success);
    EXPECT_NE(reply.message.find(reason), std::string::npos) << reply.message;
  }

  const Pose home_{Vec3(0.1, 0, 0.1), Quat(0, 1, 0, 0)};
  Topic<FrameInputMessage> inputs_{"/simulator/inputs"};
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics_{"/diagnostics"};
  Arm probe_{"probe"};
};

TEST_F(Stranger, StampsFarOffAndThePosesOwnFrameAreRefused) {
  probe_.send(home_);
  const int stamps = refused("stamp far ahead"), own = refused("its own frame");
  ASSERT_GE(stamps, 0);
  const ros::Time last(4294967295u, 999999999u);
  ASSERT_TRUE(wait_until([&] { return inputs_.last()->tools[1].present; }));
  probe_.send(home_, "probe", last);
  probe_.send(home_, "", last);
  probe_.send(home_, "probe");
  probe_.send(home_, "/probe");
  EXPECT_TRUE(wait_until([&] {
    return refused("stamp far ahead") == stamps + 2 && refused("its own frame") == own + 2;
  }));
}

TEST_F(Stranger, TransformsFarOffOrNoRotationStopNothing) {
  ros::NodeHandle node;
  ros::Publisher tf = node.advertise<tf2_msgs::TFMessage>("/tf_static", 10, true);
  ASSERT_TRUE(wait_until([&] { return tf.getNumSubscribers() > 0; }));
  const auto send = [&](const char* child, double x, double w, const ros::Time& stamp) {
    geometry_msgs::TransformStamped t;
    t.header.frame_id = "world";
    t.header.stamp = stamp;
    t.child_frame_id = child;
    t.transform.translation.x = x;
    t.transform.rotation.w = w;
    tf2_msgs::TFMessage m;
    m.transforms = {t};
    tf.publish(m);
    ros::WallDuration(0.3).sleep();
  };
  Cut::Request cut = plane_cut(0.001);
  const auto answer = [&](const char* frame) {
    cut.header.frame_id = frame;
    return call<Cut>("cut", cut);
  };
  send("late", 0, 1, ros::Time(4294967295u, 999999999u));
  EXPECT_FALSE(answer("late").success);
  send("infinite", std::numeric_limits<double>::infinity(), 1, ros::Time::now());
  EXPECT_FALSE(answer("infinite").success);
  send("huge", 1e300, 1, ros::Time::now());
  EXPECT_FALSE(answer("huge").success);
  send("rounded", 0, 1.002, ros::Time::now());
  const Cut::Response rounded = answer("rounded");
  EXPECT_TRUE(rounded.success) << rounded.message;
}

TEST_F(Stranger, CutsOfTooManyEdgesOrTooFarAreRefused) {
  Cut::Request cut = plane_cut(0.001);
  cut.edge.resize(2000, cut.edge.back());
  cut.path.resize(2000, cut.path.back());
  Cut::Response reply = call<Cut>("cut", cut);
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.message.find("at most 100000"), std::string::npos) << reply.message;
  cut = plane_cut(0.001);
  cut.path[1].position.x = 1e300;
  EXPECT_FALSE(call<Cut>("cut", cut).success);
  cut = plane_cut(0.001);
  cut.edge[1].x = 1e300;
  reply = call<Cut>("cut", cut);
  EXPECT_FALSE(reply.success);
  EXPECT_EQ(reply.message.find("misses"), std::string::npos) << reply.message;
}

TEST_F(Stranger, LoadsOnlyFilesFromWhereItIsPermitted) {
  std::string slab;
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", slab));
  EXPECT_TRUE(load(slab).success);
  expect_refused(load("/etc/passwd"), "load_folders");
  expect_refused(load("", "bodies: [{shape: mesh, mesh: /etc/passwd}]"), "load_folders");
  expect_refused(load("", "{fragment_network: /etc/passwd, bodies: [{}]}"), "load_folders");
  const auto begin = ros::WallTime::now();
  for (int i = 0; i < 5; ++i) expect_refused(load("/dev/zero"), "load_folders");
  EXPECT_LT((ros::WallTime::now() - begin).toSec(), 5);
}

TEST_F(Stranger, ScenesThatTakeTooMuchAreRefused) {
  expect_refused(load("", "{cell_size: 0.001, bodies: [{}]}"), "points");
  expect_refused(load("", "{cell_size: 0.01, ground: {z: 1}, bodies: [{}]}"), "below the ground");
  expect_refused(load("",
                      "{frame_rate: 1, cell_size: 1e-4, materials: [{name: m, density: 100, "
                      "viscosity: 1000}], bodies: [{size: [2e-4, 2e-4, 2e-4], material: m}]}"),
                 "viscosity");
  expect_refused(load("",
                      "{cell_size: 0.01, bodies: [{pose: {position: [0, 0, 0.02]}}], tools: "
                      "[{name: world}]}"),
                 "world");
  expect_refused(load("", "bodies: [{}]\n---\nbodies: [{}]\n"), "several documents");
  expect_refused(load("", "name: " + std::string(9000000, 'a')), "too large");
}

TEST_F(Stranger, ClientsThatCallAllAtOnceAreAnswered) {
  std::string slab;
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", slab));
  std::atomic<int> answered{0};
  std::vector<std::thread> clients;
  for (int c = 0; c < 8; ++c) {
    clients.emplace_back([&, c] {
      for (int i = 0; i < 10; ++i) {
        switch ((c + i) % 5) {
          case 0:
            load(slab);
            break;
          case 1:
            trigger("reset");
            break;
          case 2:
            call<Cut>("cut", plane_cut(0.001 * i));
            break;
          case 3: {
            StartRecording::Request request;
            call<StartRecording>("start_recording", request);
            break;
          }
          case 4:
            trigger("stop_recording");
            break;
        }
        ++answered;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(answered, 80);
  trigger("stop_recording");
}

// A mesh that was exchanged, since its scene was loaded, for a link to elsewhere.
TEST_F(Stranger, WhatIsBuiltAgainReadsOnlyFromWhereItIsPermitted) {
  std::string folders, slab;
  ASSERT_TRUE(ros::param::get("/simulator/load_folders", folders));
  ASSERT_TRUE(ros::param::get("/simulator/scene_file", slab));
  const std::string mesh = folders.substr(folders.find(':') + 1) + "/a.mesh";
  const TemporaryFolder elsewhere;
  const std::string tetrahedron =
      "Dimension 3 Vertices 4 0 0 0 0 0.08 0 0 0 0 0.08 0 0 0 0 0.08 0 Tetrahedra 1 1 2 3 4 0";
  const std::string secret = elsewhere.write("secret.mesh", tetrahedron);
  std::ofstream(mesh) << tetrahedron;
  const LoadScene::Response loaded =
      load("", "{cell_size: 0.01, bodies: [{shape: mesh, mesh: " + mesh + "}]}");
  ASSERT_TRUE(loaded.success) << loaded.message;
  SaveState::Request saved;
  saved.path = "permitted";
  ASSERT_TRUE(call<SaveState>("save_state", saved).success);
  RestoreState::Request restored;
  restored.path = "permitted";
  EXPECT_TRUE(call<RestoreState>("restore_state", restored).success);

  std::filesystem::remove(mesh);
  std::filesystem::create_symlink(secret, mesh);
  for (const std::string& message :
       {trigger("reset").message, call<RestoreState>("restore_state", restored).message}) {
    EXPECT_NE(message.find("load_folders"), std::string::npos) << message;
  }
  std::filesystem::remove(mesh);
  std::ofstream(mesh) << tetrahedron;
  EXPECT_TRUE(trigger("reset").success);
  EXPECT_TRUE(load(slab).success);
}

TEST_F(Stranger, StatesAreReadAndWrittenUpToALimit) {
  std::string folder;
  ASSERT_TRUE(ros::param::get("/simulator/recording_folder", folder));
  SaveState::Request save;
  SaveState::Response saved;
  int count = 0;
  do {
    save.path = "state" + std::to_string(count);
    saved = call<SaveState>("save_state", save);
  } while (saved.success && ++count < 1000);
  EXPECT_GT(count, 1);
  EXPECT_NE(saved.message.find("recording_limit"), std::string::npos) << saved.message;
  double bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".state") bytes += std::filesystem::file_size(entry.path());
  }
  EXPECT_LE(bytes, 4 << 20);

  RestoreState::Request restore;
  restore.path = "state0";
  std::filesystem::resize_file(folder + "/state1.state", std::uintmax_t(3) << 30);  // a hole
  EXPECT_TRUE(call<RestoreState>("restore_state", restore).success);
  restore.path = "state1";
  const auto restored = call<RestoreState>("restore_state", restore);
  EXPECT_FALSE(restored.success);
  EXPECT_NE(restored.message.find("too large"), std::string::npos) << restored.message;
}

/// A node of its own, started with these arguments.
pid_t start_node(const std::string& name, std::vector<std::string> arguments) {
  const std::string node =
      (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "simulator_node").string();
  arguments.insert(arguments.begin(), {node, "__name:=" + name});
  const pid_t child = fork();
  if (child != 0) return child;
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(&a[0]);
  argv.push_back(nullptr);
  execv(node.c_str(), argv.data());
  _exit(127);
}

/// Seconds until the process ends after a signal; kills it after 20.
double seconds_to_end(pid_t child, int signal) {
  const auto begin = ros::WallTime::now();
  kill(child, signal);
  int status;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if ((ros::WallTime::now() - begin).toSec() > 20) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return 1e9;
    }
    ros::WallDuration(0.05).sleep();
  }
  return (ros::WallTime::now() - begin).toSec();
}

TEST(Signal, EndsANodeWithinSecondsWhateverItDoes) {
  const std::pair<const char*, double> scenes[] = {
      // a fibre that lies diagonally in its box: minutes of sampling
      {"{cell_size: 0.001, bodies: [{size: [6, 0.001, 0.001], pose: {position: [0, 0, 3], "
       "orientation: [0, -0.3250576, 0.3250576, 0.8880738]}}]}",
       3},
      // many points: a long frame
      {"{cell_size: 0.001, bodies: [{size: [0.1, 0.1, 0.1], pose: {position: [0, 0, 0.05]}}]}", 8},
      {"{cell_size: 0.01, bodies: [{pose: {position: [0, 0, 0.015]}}]}", 1}};
  int run = 0;
  for (const auto& [scene, seconds] : scenes) {
    const std::string name = "ended" + std::to_string(run++);
    const pid_t child = start_node(name, {std::string("_scene:=") + scene});
    ros::WallDuration(seconds).sleep();
    EXPECT_LT(seconds_to_end(child, run % 2 == 0 ? SIGINT : SIGTERM), 9) << scene;
    ros::param::del("/" + name);
  }
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("stranger_test")
