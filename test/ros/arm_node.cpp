// A CRTK arm that moves a tool: clients of our own do what those of CRTK and dVRK do. The rest of
// its tests: arm_forces.cpp, arm_states.cpp.
#include <geometry_msgs/TwistStamped.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Empty.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>

#include <limits>
#include <memory>

#include "arm_client.h"

namespace tissue_sim {
namespace {

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
  expect_heard<WrenchStamped>({"servo_cf", "body/servo_cf", "spatial/servo_cf"});
  expect_heard<geometry_msgs::TwistStamped>({"servo_cv"});
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

TEST_F(CrtkArm, ServoByVelocityMovesAndEndsByItself) {
  const Pose start = tip();
  geometry_msgs::TwistStamped m;
  m.twist.linear.x = 0.05;
  m.twist.angular.z = 0.5;
  for (int i = 0; i < 20; ++i) {
    send("servo_cv", m);
    ros::WallDuration(0.01).sleep();
  }
  ASSERT_TRUE(wait_until([&] { return tip().position.x() - start.position.x() > 0.008; }, 3));
  ros::WallDuration(0.6).sleep();  // nobody sends any more
  const Pose end = tip();
  ros::WallDuration(0.3).sleep();
  EXPECT_LT((tip().position - end.position).norm(), 1e-9);
  const Vec3 way = end.position - start.position;
  EXPECT_LT(way.x(), 0.05);
  EXPECT_LT(std::hypot(way.y(), way.z()), 1e-6) << "along x alone";
  EXPECT_NEAR(end.orientation.angularDistance(start.orientation), 10 * way.x(), 1e-6);
  m.twist.linear.x = std::nan("");
  send("servo_cv", m);
  m.twist.linear.x = 0.05;
  m.header.frame_id = "nowhere";
  send("servo_cv", m);
  ros::WallDuration(0.3).sleep();
  EXPECT_LT((tip().position - end.position).norm(), 1e-9) << "is refused";
}

// NaN, too many and too few joints, for 2 s and 4 000 messages at least (10 000 a second where the
// machine is idle): the arm goes on, and stays where it is.
TEST_F(CrtkArm, OutlastsAStormOfNonsense) {
  const Values q = setpoint_js.next()->position;
  Pose nan = tip();
  nan.position.x() = std::nan("");
  geometry_msgs::TwistStamped twist;
  twist.twist.angular.x = std::numeric_limits<double>::infinity();
  const auto end = ros::WallTime::now() + ros::WallDuration(2);
  int sent = 0;
  while (sent < 4000 || ros::WallTime::now() < end) {
    send_joints("servo_jp", Values(6, std::nan("")));
    send_joints("servo_jp", Values(5, 0.0));
    send_joints("servo_jr", Values(1000, 0.1));
    send_joints("jaw/servo_jp", Values());
    send_joints("move_jp", Values(7, 0.0));
    send_pose("servo_cp", nan);
    send("servo_cv", twist);
    send("servo_cf", WrenchStamped());
    sent += 8;
    ros::WallDuration(0.0008).sleep();
  }
  const std::size_t before = measured_js.count();
  EXPECT_TRUE(wait_until([&] { return measured_js.count() > before + 20; }, 5));
  EXPECT_LT(distance(measured_js.last()->position, q), 1e-9);
  ASSERT_TRUE(wait_until(
      [&] {  // refused moves are busy for 50 ms each, 32 at most wait
        send_joints("servo_jp", {0.1, 0, 0.12, 0, 0, 0});
        return distance(measured_js.last()->position, {0.1, 0, 0.12, 0, 0, 0}) < 1e-9;
      },
      5));
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

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("arm_test")
