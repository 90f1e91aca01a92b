// A CRTK arm that moves a tool: clients of our own do what those of CRTK and dVRK do.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Empty.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#ifdef TISSUE_SIM_HAS_CRTK_MSGS
#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/QueryForwardKinematics.h>
#include <crtk_msgs/QueryInverseKinematics.h>
#include <crtk_msgs/StringStamped.h>
#endif

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "arm/kinematics.h"
#include "simulator_client.h"

namespace tissue_sim {
namespace {

using geometry_msgs::PoseStamped;
using geometry_msgs::WrenchStamped;
using sensor_msgs::JointState;
using Values = std::vector<double>;

const std::string kArm = "/PSM1/";

class CrtkArm : public testing::Test {
 protected:
  CrtkArm()
      : measured_js(kArm + "measured_js"),
        setpoint_js(kArm + "setpoint_js"),
        measured_cp(kArm + "measured_cp"),
        setpoint_cp(kArm + "setpoint_cp") {}

  void SetUp() override {
    pause(false);
    ASSERT_TRUE(wait_until([&] { return valid(measured_js) && valid(setpoint_cp); }));
    move_jp({0, 0, 0.12, 0, 0, 0});
  }

  template <class M>
  static bool valid(const Topic<M>& topic) {
    const auto m = topic.last();
    return m && !m->header.stamp.isZero();
  }

  // Publishes once there is a listener.
  template <class M>
  void send(const std::string& name, const M& message, int queue = 100) {
    auto& publisher = publishers_[name];
    if (!publisher) {
      publisher = node_.advertise<M>(kArm + name, queue);
      ASSERT_TRUE(wait_until([&] { return publisher.getNumSubscribers() > 0; })) << name;
    }
    publisher.publish(message);
  }
  void send_joints(const std::string& name, const Values& q, const Values& v = {}) {
    JointState m;
    m.position = q;
    m.velocity = v;
    send(name, m);
  }
  void send_pose(const std::string& name, const Pose& pose, const std::string& frame = "") {
    PoseStamped m;  // clients leave stamp and frame empty
    m.header.frame_id = frame;
    m.pose = to_pose(pose);
    send(name, m);
  }

  static double distance(const Values& a, const Values& b) {
    double d = a.size() == b.size() ? 0 : 1e9;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
      d = std::max(d, std::fabs(a[i] - b[i]));
    }
    return d;
  }
  bool arrives(const Values& q, double seconds = 20) {
    return wait_until([&] { return distance(measured_js.last()->position, q) < 1e-9; }, seconds);
  }
  void move_jp(const Values& q) {
    send_joints("move_jp", q);
    ASSERT_TRUE(arrives(q));
  }
  Pose tip() { return from_message(measured_cp.last()->pose); }

  template <class M>
  static void expect_rising(const Topic<M>& topic) {
    ros::Time last;
    for (const auto& m : topic.all()) {
      if (m->header.stamp.isZero()) continue;
      ASSERT_GT(m->header.stamp, last);
      last = m->header.stamp;
    }
  }

  ros::NodeHandle node_;
  std::map<std::string, ros::Publisher> publishers_;
  Topic<JointState> measured_js, setpoint_js;
  Topic<PoseStamped> measured_cp, setpoint_cp;
};

template <class M>
void expect_published(const std::vector<std::string>& names) {
  std::vector<std::unique_ptr<Topic<M>>> topics;  // all first: each takes a while to connect
  for (const std::string& name : names) topics.push_back(std::make_unique<Topic<M>>(kArm + name));
  for (std::size_t i = 0; i < names.size(); ++i) EXPECT_TRUE(topics[i]->last()) << names[i];
}

template <class M>
void expect_heard(const std::vector<std::string>& names) {
  ros::NodeHandle node;
  std::vector<ros::Publisher> topics;
  for (const std::string& name : names) topics.push_back(node.advertise<M>(kArm + name, 1));
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_TRUE(wait_until([&] { return topics[i].getNumSubscribers() > 0; })) << names[i];
  }
}

TEST_F(CrtkArm, HasTheGraphThatDvrkChecks) {
  expect_published<JointState>(
      {"measured_js", "setpoint_js", "jaw/measured_js", "jaw/setpoint_js"});
  expect_published<PoseStamped>(
      {"measured_cp", "setpoint_cp", "local/measured_cp", "local/setpoint_cp"});
  expect_published<geometry_msgs::TwistStamped>({"measured_cv"});
  expect_published<WrenchStamped>({"body/measured_cf", "spatial/measured_cf"});
  expect_published<std_msgs::Float64MultiArray>({"body/jacobian", "spatial/jacobian"});
  expect_published<std_msgs::Float64>({"trajectory_j/ratio"});
  expect_heard<JointState>({"servo_jp", "servo_jr", "servo_jf", "move_jp", "move_jr",
                            "jaw/servo_jp", "jaw/move_jp", "jaw/servo_jf"});
  expect_heard<PoseStamped>({"servo_cp", "servo_cr", "move_cp", "move_cr"});
  expect_heard<WrenchStamped>({"body/servo_cf", "spatial/servo_cf"});
  expect_heard<std_msgs::Empty>({"hold", "free"});
  expect_heard<std_msgs::Float64>({"trajectory_j/set_ratio"});
  expect_heard<std_msgs::Bool>(
      {"use_gravity_compensation", "body/set_cf_orientation_absolute", "emulate_tool_present"});
}

TEST_F(CrtkArm, FollowsServoInACircle) {
  const Pose start = tip();
  EXPECT_LT((start.position - Vec3(0, 0, 0.0463)).norm(), 1e-9) << "as arm.launch places it";
  Pose goal = start;
  for (int i = 0; i <= 150; ++i) {
    const double angle = 2 * M_PI * i / 150;
    goal.position = start.position + Vec3(0.01 * (1 - std::cos(angle)), 0.01 * std::sin(angle), 0);
    send_pose("servo_cp", goal);
    ros::WallDuration(0.01).sleep();
    if (i % 30 == 0) {
      EXPECT_TRUE(wait_until(
          [&] {
            return (from_message(setpoint_cp.last()->pose).position - goal.position).norm() < 1e-9;
          },
          2));
    }
  }
  EXPECT_TRUE(wait_until([&] { return (tip().position - start.position).norm() < 1e-9; }, 2));
  EXPECT_LT(tip().orientation.angularDistance(start.orientation), 1e-6);
  expect_rising(measured_cp);
  expect_rising(setpoint_cp);
  expect_rising(measured_js);
}

TEST_F(CrtkArm, ServoComesInAnyFrameAndInSteps) {
  const Pose start = tip();
  const Vec3 base(0, 0, 0.17);
  send_pose("servo_cp", {start.position + Vec3(0.01, 0, 0) - base, start.orientation}, "PSM1_base");
  EXPECT_TRUE(wait_until(
      [&] { return (tip().position - start.position - Vec3(0.01, 0, 0)).norm() < 1e-9; }, 2));
  send_pose("servo_cr", {Vec3(0, 0.005, 0), Quat::Identity()});
  EXPECT_TRUE(wait_until(
      [&] { return (tip().position - start.position - Vec3(0.01, 0.005, 0)).norm() < 1e-9; }, 2));
  const Values now = setpoint_js.next()->position;
  send_joints("servo_jr", {0, 0, 0.01, 0, 0, 0});
  send_joints("servo_jr", {0, 0, 0.01, 0, 0, 0});
  Values deeper = now;
  deeper[2] += 0.02;
  EXPECT_TRUE(arrives(deeper, 3));
}

TEST_F(CrtkArm, MovesQueueAndServoSupersedesThem) {
  const Values first = {0.1, 0, 0.12, 0, 0, 0}, second = {0.1, 0.1, 0.12, 0.5, 0.2, 0.1};
  const std::size_t before = measured_js.count();
  send_joints("move_jp", first);
  send_joints("move_jp", second);
  ASSERT_TRUE(arrives(second));
  bool passed = false;
  const auto all = measured_js.all();
  for (std::size_t i = before; i < all.size(); ++i) {
    passed |= distance(all[i]->position, first) < 1e-9;
    for (const double v : all[i]->velocity) ASSERT_LT(std::fabs(v), 2.01);
  }
  EXPECT_TRUE(passed) << "the first was reached before the second began";
  send_joints("move_jp", {1.2, 0, 0.12, 0, 0, 0});
  ros::WallDuration(0.2).sleep();
  send_joints("servo_jp", first, Values(6, 0.0));
  EXPECT_TRUE(arrives(first, 5));
  ros::WallDuration(0.5).sleep();
  EXPECT_TRUE(arrives(first, 0.1)) << "the move is forgotten";
  Pose goal = from_message(setpoint_cp.next()->pose);
  goal.position += Vec3(-0.02, 0.01, 0.005);
  send_pose("move_cp", goal);
  EXPECT_TRUE(wait_until([&] { return (tip().position - goal.position).norm() < 1e-9; }, 5));
}

TEST_F(CrtkArm, FeelsTheTissue) {
  Topic<WrenchStamped> body(kArm + "body/measured_cf"), spatial(kArm + "spatial/measured_cf");
  ASSERT_TRUE(wait_until([&] { return valid(body) && valid(spatial); }));
  EXPECT_EQ(body.last()->wrench.force.z, 0) << "in the air";
  EXPECT_EQ(body.last()->header.frame_id, "PSM1");
  move_jp({0.1, 0, 0.153, 0, 0, 0});
  EXPECT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z > 0.02; }))
      << "it pushes the tool up";
  EXPECT_TRUE(wait_until([&] { return measured_js.last()->effort[2] < -0.02; }))
      << "and the insertion back";
  bool paired = false;
  for (const auto& b : body.all()) {  // of one frame, in two axes
    for (const auto& s : spatial.all()) {
      if (b->header.stamp != s->header.stamp || b->header.stamp.isZero()) continue;
      const auto norm = [](const geometry_msgs::Vector3& v) { return std::hypot(v.x, v.y, v.z); };
      ASSERT_NEAR(norm(b->wrench.force), norm(s->wrench.force), 1e-9);
      paired |= b->wrench.force.z < -0.02 && s->wrench.force.z > 0.02;
    }
  }
  EXPECT_TRUE(paired);
  // The tip's axes: at rest its x is the world's y, turned with the yaw.
  const auto b = body.next();
  const Quat turned = tip().orientation;
  EXPECT_TRUE(wait_until([&] {
    for (const auto& s : spatial.all()) {
      if (s->header.stamp != b->header.stamp) continue;
      const auto& w = s->wrench.force;
      const auto& l = b->wrench.force;
      EXPECT_LT((turned * Vec3(l.x, l.y, l.z) - Vec3(w.x, w.y, w.z)).norm(), 1e-6);
      return true;
    }
    return false;
  }));
  expect_rising(body);
  expect_rising(spatial);
}

TEST_F(CrtkArm, JawsAreTheGraspers) {
  Topic<JawGrip> grip("/simulator/grasper/grip");
  Topic<JointState> jaw(kArm + "jaw/measured_js"), asked(kArm + "jaw/setpoint_js");
  send_joints("jaw/move_jp", {1.0});
  EXPECT_TRUE(wait_until([&] { return grip.last() && std::fabs(grip.last()->jaw - 1) < 1e-6; }));
  EXPECT_TRUE(wait_until([&] { return std::fabs(jaw.last()->position[0] - 1) < 1e-6; }));
  send_joints("jaw/servo_jp", {-20 * M_PI / 180});
  EXPECT_TRUE(wait_until([&] { return grip.last()->pressure_limit > 5900; })) << "they squeeze";
  EXPECT_TRUE(wait_until([&] { return jaw.last()->position[0] < 1e-6; }));
  EXPECT_NEAR(jaw.last()->position[0], 0, 1e-6) << "where they are";
  EXPECT_NEAR(asked.last()->position[0], -20 * M_PI / 180, 1e-9) << "what was asked for";
}

TEST_F(CrtkArm, RefusesWhatItCannot) {
  const Values q = setpoint_js.last()->position;
  const Pose start = tip();
  send_joints("servo_jp", {0, 0, 0.5, 0, 0, 0});
  send_joints("servo_jp", {0, 0, 0.1});
  send_joints("move_jp", {0, 2, 0.12, 0, 0, 0});
  send_pose("servo_cp", {start.position + Vec3(0, 0, std::nan("")), start.orientation});
  send_pose("servo_cp", {start.position, Quat(0, 0, 0, 0)});
  send_pose("servo_cp", {start.position - Vec3(0, 0, 0.3), start.orientation});
  send_pose("move_cp", start, "nowhere");
  JointState torque;
  torque.effort = {1, 1, 1, 1, 1, 1};
  send("servo_jf", torque);
  ros::WallDuration(0.5).sleep();
  EXPECT_EQ(distance(setpoint_js.next()->position, q), 0);
  EXPECT_EQ(distance(measured_js.next()->position, q), 0);
}

TEST_F(CrtkArm, RatioSlowsMoves) {
  Topic<std_msgs::Float64> ratio(kArm + "trajectory_j/ratio");
  std_msgs::Float64 m;
  m.data = 0.5;
  send("trajectory_j/set_ratio", m);
  EXPECT_TRUE(wait_until([&] { return ratio.last()->data == 0.5; }));
  const std::size_t before = measured_js.count();
  move_jp({0.3, 0, 0.12, 0, 0, 0});
  double fastest = 0;
  const auto all = measured_js.all();
  for (std::size_t i = before; i < all.size(); ++i) {
    fastest = std::max(fastest, std::fabs(all[i]->velocity[0]));
  }
  EXPECT_LT(fastest, 0.505);
  m.data = 2;
  send("trajectory_j/set_ratio", m);
  m.data = 1;
  send("trajectory_j/set_ratio", m);
  EXPECT_TRUE(wait_until([&] { return ratio.last()->data == 1; }));
  for (const auto& said : ratio.all()) EXPECT_LE(said->data, 1);
}

TEST_F(CrtkArm, WithoutAToolItHasNoPose) {
  std_msgs::Bool m;
  m.data = false;
  send("emulate_tool_present", m);
  EXPECT_TRUE(wait_until([&] { return measured_cp.last()->header.stamp.isZero(); }));
  EXPECT_TRUE(valid(measured_js));
  m.data = true;
  send("emulate_tool_present", m);
  EXPECT_TRUE(wait_until([&] { return valid(measured_cp) && valid(setpoint_cp); }));
}

TEST_F(CrtkArm, HoldStopsIt) {
  send_joints("move_jp", {1, 0, 0.12, 0, 0, 0});
  EXPECT_TRUE(wait_until([&] { return measured_js.last()->position[0] > 0.1; }));
  send("hold", std_msgs::Empty());
  ros::WallDuration(0.3).sleep();
  const Values q = measured_js.next()->position;
  EXPECT_LT(q[0], 0.9);
  EXPECT_EQ(distance(setpoint_js.next()->position, q), 0);
}

TEST_F(CrtkArm, NothingIsValidWhileTheClockStands) {
  pause(true);
  EXPECT_TRUE(wait_until([&] { return measured_js.last()->header.stamp.isZero(); }, 5));
  pause(false);
  EXPECT_TRUE(wait_until([&] { return valid(measured_js); }, 5));
}

#ifdef TISSUE_SIM_HAS_CRTK_MSGS

class CrtkState : public CrtkArm {
 protected:
  CrtkState() : state(kArm + "operating_state"), warning(kArm + "warning") {}
  void command(const std::string& word) {
    crtk_msgs::StringStamped m;
    m.string = word;
    send("state_command", m);
  }
  bool becomes(const std::string& name) {
    return wait_until([&] { return state.last() && state.last()->state == name; }, 3);
  }
  Topic<crtk_msgs::OperatingState> state;
  Topic<crtk_msgs::StringStamped> warning;
};

TEST_F(CrtkState, IsBusyOnEachTick) {
  for (const double yaw : {0.2, 0.2}) {  // the second has no way to go
    const std::size_t before = state.count();
    const ros::Time asked = ros::Time::now();
    send_joints("move_jp", {yaw, 0, 0.12, 0, 0, 0});
    const auto seen = [&](bool busy) {
      const auto all = state.all();
      for (std::size_t i = before; i < all.size(); ++i) {
        if (all[i]->is_busy == busy && all[i]->header.stamp > asked) return true;
      }
      return false;
    };
    EXPECT_TRUE(wait_until([&] { return seen(true); }, 5));
    EXPECT_TRUE(wait_until([&] { return seen(true) && !state.last()->is_busy; }, 5));
    const auto all = state.all();
    const int busy =
        static_cast<int>(std::count_if(all.begin() + static_cast<long>(before), all.end(),
                                       [](const auto& m) { return m->is_busy; }));
    EXPECT_GE(busy, 3);
    // It had arrived before it said that it is idle.
    const ros::Time idle = state.last()->header.stamp;
    ASSERT_TRUE(wait_until([&] { return measured_js.last()->header.stamp >= idle; }, 5));
    const auto joints = measured_js.all();
    const auto began = std::find_if(all.begin() + static_cast<long>(before), all.end(),
                                    [](const auto& m) { return m->is_busy; });
    const auto first = std::find_if(began, all.end(), [](const auto& m) { return !m->is_busy; });
    ASSERT_TRUE(first != all.end());
    const auto before_idle = std::find_if(joints.rbegin(), joints.rend(), [&](const auto& m) {
      return m->header.stamp < (*first)->header.stamp;
    });
    ASSERT_TRUE(before_idle != joints.rend());
    EXPECT_NEAR((*before_idle)->position[0], yaw, 1e-9);
  }
  expect_rising(state);
}

TEST_F(CrtkState, CommandsChangeIt) {
  command("disable");
  EXPECT_TRUE(becomes("DISABLED"));
  EXPECT_TRUE(wait_until([&] { return setpoint_js.last()->header.stamp.isZero(); }));
  EXPECT_TRUE(valid(measured_js));
  const std::size_t refused = warning.count();
  send_joints("move_jp", {0.5, 0, 0.12, 0, 0, 0});
  EXPECT_TRUE(wait_until([&] { return warning.count() > refused; }));
  EXPECT_EQ(warning.last()->string, "move_jp refused: the arm is DISABLED, must be ENABLED");
  EXPECT_TRUE(arrives({0, 0, 0.12, 0, 0, 0}, 0.5));
  command("enable");
  EXPECT_TRUE(becomes("ENABLED"));
  command("unhome");
  EXPECT_TRUE(wait_until([&] { return !state.last()->is_homed; }));
  EXPECT_TRUE(wait_until([&] { return measured_js.last()->header.stamp.isZero(); }));
  command("home");
  EXPECT_TRUE(wait_until([&] { return state.last()->is_homed && valid(setpoint_js); }));
}

TEST_F(CrtkState, KinematicsAreServices) {
  crtk_msgs::QueryForwardKinematics forward;
  forward.request.jp = {0.2, -0.1, 0.14, 0.4, 0.3, -0.2};
  ASSERT_TRUE(ros::service::call(kArm + "forward_kinematics", forward));
  EXPECT_TRUE(forward.response.result);
  crtk_msgs::QueryInverseKinematics inverse;
  inverse.request.cp = forward.response.cp;
  ASSERT_TRUE(ros::service::call(kArm + "inverse_kinematics", inverse));
  EXPECT_LT(distance(inverse.response.jp, forward.request.jp), 1e-9);
  ASSERT_TRUE(ros::service::call(kArm + "local/forward_kinematics", forward));
  EXPECT_NEAR(forward.response.cp.position.z, inverse.request.cp.position.z - 0.17, 1e-12);
  forward.request.jp[2] = 1;
  ASSERT_TRUE(ros::service::call(kArm + "forward_kinematics", forward));
  EXPECT_FALSE(forward.response.result);
  EXPECT_EQ(forward.response.message, "outer_insertion is 1, it goes from 0 to 0.24");
}

#endif

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("arm_test")
