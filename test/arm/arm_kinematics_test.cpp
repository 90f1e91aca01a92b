// A tool about its remote centre: against the chain of its Denavit-Hartenberg parameters, against
// numeric differentiation, and there and back.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "arm/kinematics.h"

namespace tissue_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

using Mat4 = Eigen::Matrix4d;

// Craig's (modified) convention: about and along x, then about and along z.
Mat4 link(double alpha, double a, double d, double theta) {
  Mat4 x = Mat4::Identity(), z = Mat4::Identity();
  x.topLeftCorner<3, 3>() = Eigen::AngleAxisd(alpha, Vec3::UnitX()).matrix();
  x(0, 3) = a;
  z.topLeftCorner<3, 3>() = Eigen::AngleAxisd(theta, Vec3::UnitZ()).matrix();
  z(2, 3) = d;
  return x * z;
}

// The parameters by which dVRK describes the manipulator with a large needle driver.
Mat4 chain(const Joints& q) {
  Mat4 tip;
  tip << 0, -1, 0, 0, 0, 0, 1, 0.0102, -1, 0, 0, 0, 0, 0, 0, 1;
  return link(kPi / 2, 0, 0, q[0] + kPi / 2) * link(-kPi / 2, 0, 0, q[1] - kPi / 2) *
         link(kPi / 2, 0, q[2] - 0.4318, 0) * link(0, 0, 0.4162, q[3]) *
         link(-kPi / 2, 0, 0, q[4] - kPi / 2) * link(-kPi / 2, 0.0091, 0, q[5] - kPi / 2) * tip;
}

Joints random_joints(std::mt19937& random, double share = 1) {
  const auto limits = arm_limits();
  Joints q;
  for (int i = 0; i < kArmJoints; ++i) {
    const double middle = 0.5 * (limits[i].lower + limits[i].upper);
    const double half = 0.5 * share * (limits[i].upper - limits[i].lower);
    q[i] = std::uniform_real_distribution<double>(middle - half, middle + half)(random);
  }
  return q;
}

TEST(ArmKinematics, IsTheChainOfItsDenavitHartenbergParameters) {
  std::mt19937 random(1);
  for (int n = 0; n < 1000; ++n) {
    const Joints q = random_joints(random);
    const Pose tip = forward_kinematics({}, q);
    const Mat4 expected = chain(q);
    ASSERT_LT((tip.position - expected.topRightCorner<3, 1>()).norm(), 1e-12);
    ASSERT_LT((tip.orientation.matrix() - expected.topLeftCorner<3, 3>()).norm(), 1e-12);
  }
}

TEST(ArmKinematics, TipIsBelowTheRemoteCentreAtZero) {
  Joints q = Joints::Zero();
  q[2] = 0.12;
  const Pose tip = forward_kinematics({}, q);
  EXPECT_LT((tip.position - Vec3(0, 0, -0.1237)).norm(), 1e-12);
  EXPECT_LT((tip.orientation * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
  EXPECT_LT((tip.orientation * Vec3::UnitZ() + Vec3::UnitZ()).norm(), 1e-12);
  // Which way the tip goes, joint by joint, as the table in kinematics.h says.
  const Jacobian j = jacobian({}, q);
  EXPECT_GT(j(0, 0), 0.1);
  EXPECT_LT(j(1, 1), -0.1);
  EXPECT_EQ(j(2, 2), -1);
  EXPECT_LT(j(1, 4), 0);
  EXPECT_GT(j(0, 5), 0);
}

TEST(ArmKinematics, JacobianIsTheDerivative) {
  std::mt19937 random(2);
  const double h = 1e-6;
  for (int n = 0; n < 200; ++n) {
    const Joints q = random_joints(random);
    const Jacobian j = jacobian({}, q);
    for (int i = 0; i < kArmJoints; ++i) {
      Joints before = q, after = q;
      before[i] -= h, after[i] += h;
      const Pose a = forward_kinematics({}, before), b = forward_kinematics({}, after);
      const Eigen::AngleAxisd turn(b.orientation * a.orientation.inverse());
      ASSERT_LT(((b.position - a.position) / (2 * h) - j.col(i).head<3>()).norm(), 1e-8);
      ASSERT_LT((turn.angle() / (2 * h) * turn.axis() - j.col(i).tail<3>()).norm(), 1e-8);
    }
    const Quat tip = forward_kinematics({}, q).orientation;
    const Jacobian body = in_axes(j, tip);
    ASSERT_LT((tip * Vec3(body.col(0).head<3>()) - j.col(0).head<3>()).norm(), 1e-12);
  }
}

TEST(ArmKinematics, PosesLeadBackToTheirJoints) {
  std::mt19937 random(3);
  int same = 0;
  const int count = 2000;
  for (int n = 0; n < count; ++n) {
    const Joints q = random_joints(random);
    const Pose tip = forward_kinematics({}, q);
    const InverseKinematics back = inverse_kinematics({}, arm_limits(), tip, q);
    ASSERT_TRUE(back.found) << q.transpose() << ": " << back.why;
    ASSERT_EQ(outside_limits(arm_limits().data(), back.joints), "");
    const Pose again = forward_kinematics({}, back.joints);
    ASSERT_LT((again.position - tip.position).norm(), 1e-10);
    ASSERT_LT(again.orientation.angularDistance(tip.orientation), 1e-7);
    same += (back.joints - q).norm() < 1e-6;
  }
  EXPECT_EQ(same, count) << "the way that is nearest to the seed is the seed";
}

TEST(ArmKinematics, ReachesNearTheRemoteCentreToo) {
  for (const double insertion : {0.0, 0.01, 0.015, 0.0161, 0.02, 0.03}) {
    Joints q;
    q << 0.3, -0.2, insertion, 1.0, 0.4, -0.5;
    const InverseKinematics back =
        inverse_kinematics({}, arm_limits(), forward_kinematics({}, q), q);
    ASSERT_TRUE(back.found) << insertion;
    EXPECT_LT((back.joints - q).norm(), 1e-6) << insertion;
  }
}

TEST(ArmKinematics, SaysWhichJointCannot) {
  Joints q = Joints::Zero();
  q[2] = 0.12;
  Pose tip = forward_kinematics({}, q);
  tip.position.z() -= 0.2;
  const InverseKinematics deep = inverse_kinematics({}, arm_limits(), tip, q);
  EXPECT_FALSE(deep.found);
  EXPECT_EQ(deep.why, "outer_insertion would be at 0.32, it goes from 0 to 0.24");
  q[1] = 2;
  EXPECT_EQ(outside_limits(arm_limits().data(), q),
            "outer_pitch is 2, it goes from -0.9346 to 0.9346");
  q[1] = std::nan("");
  EXPECT_EQ(outside_limits(arm_limits().data(), q), "outer_pitch is not finite");
}

}  // namespace
}  // namespace tissue_sim
