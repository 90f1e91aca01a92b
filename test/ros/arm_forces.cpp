// What an arm feels: forces on its tool, along its own axes and the world's, and on its joints.
#include <geometry_msgs/TwistStamped.h>
#include <std_msgs/Float64MultiArray.h>

#include "arm/kinematics.h"
#include "arm_client.h"

namespace tissue_sim {
namespace {

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
  Quat turned = tip().orientation;
  EXPECT_TRUE(wait_until([&] {  // it stands: poses and forces have other stamps
    const Quat before = turned;
    turned = from_message(measured_cp.next()->pose).orientation;
    return turned.angularDistance(before) < 1e-7;
  }));
  body.next();  // may be of the frame before
  const auto b = body.next();
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

TEST_F(CrtkArm, ASecondOneLeans) {
  const std::string arm = "/PSM2/";
  Topic<PoseStamped> world(arm + "measured_cp"), local(arm + "local/measured_cp");
  Topic<geometry_msgs::TwistStamped> twist(arm + "measured_cv");
  Topic<JointState> joints(arm + "measured_js");
  Topic<WrenchStamped> force(arm + "spatial/measured_cf");
  Topic<std_msgs::Float64MultiArray> jacobian(arm + "spatial/jacobian");
  ASSERT_TRUE(wait_until([&] { return valid(world) && valid(local) && valid(joints); }));
  const Pose base{Vec3(-0.05, 0, 0.16), Quat(Eigen::AngleAxisd(-20 * M_PI / 180, Vec3::UnitY()))};
  const auto at = [&] { return from_message(world.next()->pose); };
  EXPECT_LT((at().position - base * Vec3(0, 0, -0.1237)).norm(), 1e-7);
  EXPECT_LT((base * from_message(local.last()->pose).position - at().position).norm(), 1e-7);

  // A step along the world's z, as the joints and the Jacobian say it.
  ros::Publisher servo = node_.advertise<PoseStamped>(arm + "servo_cp", 1);
  ASSERT_TRUE(wait_until([&] { return servo.getNumSubscribers() > 0; }));
  const auto matrix = [&] {
    const auto m = jacobian.next();
    return Jacobian(Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(m->data.data()));
  };
  const auto vector = [](const Values& q) { return Joints(Eigen::Map<const Joints>(q.data())); };
  const Pose start = at();
  const Joints before = vector(joints.last()->position);
  PoseStamped goal;
  goal.pose = to_pose({start.position + Vec3(0, 0, 0.0005), start.orientation});
  servo.publish(goal);
  ASSERT_TRUE(wait_until([&] { return (at().position - start.position).norm() > 4.999e-4; }, 5));
  EXPECT_LT((at().position - start.position - Vec3(0, 0, 0.0005)).norm(), 1e-9);
  ros::WallDuration(0.1).sleep();
  const Eigen::Matrix<double, 6, 1> way = matrix() * (vector(joints.next()->position) - before);
  EXPECT_LT((way.head<3>() - Vec3(0, 0, 0.0005)).norm(), 5e-6);
  EXPECT_LT(way.tail<3>().norm(), 1e-4);

  // On its way down, its velocity is the Jacobian's; at its end it loads the joints.
  ros::Publisher move = node_.advertise<JointState>(arm + "move_jp", 1);
  ASSERT_TRUE(wait_until([&] { return move.getNumSubscribers() > 0; }));
  JointState deeper;
  deeper.position = {0, 0, 0.12, 0, 0, 0};
  move.publish(deeper);
  ASSERT_TRUE(
      wait_until([&] { return distance(joints.last()->position, deeper.position) < 1e-12; }, 10));
  const std::size_t still = twist.next() ? twist.count() : 0;
  deeper.position[2] = 0.153;
  move.publish(deeper);
  ASSERT_TRUE(wait_until([&] { return joints.last()->position[2] > 0.1529; }, 10));
  double fastest = 0;
  Vec3 speed = Vec3::Zero();
  const auto twists = twist.all();
  for (std::size_t i = still; i < twists.size(); ++i) {
    const auto& l = twists[i]->twist.linear;
    const Vec3 v(l.x, l.y, l.z);
    if (v.norm() > fastest) fastest = v.norm(), speed = v;
  }
  EXPECT_NEAR(fastest, 0.1, 0.002);
  EXPECT_LT((speed.normalized() - base.orientation * Vec3(0, 0, -1)).norm(), 1e-3);
  EXPECT_TRUE(wait_until([&] { return force.last()->wrench.force.z > 0.02; }));
  ros::WallDuration(0.5).sleep();
  const auto f = force.next()->wrench;
  Eigen::Matrix<double, 6, 1> load;
  load << f.force.x, f.force.y, f.force.z, f.torque.x, f.torque.y, f.torque.z;
  const Joints expected = matrix().transpose() * load;
  ros::WallDuration(0.05).sleep();
  const Joints effort = vector(joints.next()->effort);
  EXPECT_LT((effort - expected).norm(), 0.1 * expected.norm());
  EXPECT_LT(effort[2], -0.02);
  deeper.position[2] = 0.11;
  move.publish(deeper);
  EXPECT_TRUE(wait_until([&] { return std::fabs(joints.last()->position[2] - 0.11) < 1e-9; }, 10));
}

}  // namespace
}  // namespace tissue_sim
