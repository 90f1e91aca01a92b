// What changes a scene while it runs, and what tells of it: anchors that move and report what they
// carry, gravity and damping, `settle`, clouds with the fields that were asked for.
#include <geometry_msgs/Vector3.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Float64.h>
#include <tissue_sim/Settle.h>

#include <cmath>
#include <cstring>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr double kWeight = 9.81 * 1000 * 0.032 * 0.02 * 0.02;  // of what no anchor holds [N]
constexpr int kEach = 32 + 4 * (3 + 3 + 3 + 1 + 6);            // bytes of a point

Settle::Response settle(double time, double damping = 20) {
  Settle::Request request;
  request.time = time;
  request.damping = damping;
  return call<Settle>("settle", request);
}

/// What a point carries behind the eight fields of all.
struct Carried {
  Vec3 rest, displacement, velocity;
  double volume, stress[6];
};

std::vector<Carried> carried(const sensor_msgs::PointCloud2& cloud) {
  std::vector<Carried> all;
  for (std::size_t i = 0; i + kEach <= cloud.data.size(); i += kEach) {
    float f[16];
    std::memcpy(f, &cloud.data[i + 32], sizeof f);
    Carried c{Vec3(f[0], f[1], f[2]), Vec3(f[3], f[4], f[5]), Vec3(f[6], f[7], f[8]), f[9], {}};
    std::copy_n(f + 10, 6, c.stress);
    all.push_back(c);
  }
  return all;
}

class SceneInput : public testing::Test {
 protected:
  SceneInput()
      : left_("/simulator/anchors/left/spatial/measured_cf"),
        right_("/simulator/anchors/right/spatial/measured_cf") {}
  void SetUp() override {
    pause(true);
    trigger("reset");
    ASSERT_TRUE(wait_until([&] { return left_.connected() && right_.connected(); }));
  }
  /// The force on an anchor in one frame more.
  static Vec3 force(const Topic<geometry_msgs::WrenchStamped>& topic) {
    const std::size_t before = topic.count();
    EXPECT_TRUE(step(1).success);
    EXPECT_TRUE(wait_until([&] { return topic.count() > before; }));
    const auto w = topic.all().back();
    EXPECT_EQ(w->header.frame_id, "world");
    return {w->wrench.force.x, w->wrench.force.y, w->wrench.force.z};
  }
  template <class M>
  static void send(const std::string& name, const M& message) {
    ros::NodeHandle node;
    ros::Publisher publisher = node.advertise<M>("/simulator/" + name, 10);
    ASSERT_TRUE(wait_until([&] { return publisher.getNumSubscribers() > 0; })) << name;
    publisher.publish(message);
    ros::WallDuration(0.3).sleep();  // until it is there
  }

  Topic<geometry_msgs::WrenchStamped> left_, right_;
};

TEST_F(SceneInput, SettleSaysWhetherItIsAtRestAndAnchorsThenCarryTheWeight) {
  Settle::Response r = settle(1.0 / 60);
  EXPECT_TRUE(r.success) << r.message;
  EXPECT_FALSE(r.at_rest) << "after a frame";
  EXPECT_GT(r.fastest, 1e-4);
  r = settle(5);
  EXPECT_TRUE(r.success) << r.message;
  EXPECT_TRUE(r.at_rest);
  EXPECT_LT(r.fastest, 1e-4);
  EXPECT_GT(r.took, 0.1);
  EXPECT_LT(r.took, 5);
  const Vec3 l = force(left_), f = force(right_);
  EXPECT_NEAR(l.z() + f.z(), -kWeight, 0.01 * kWeight);
  EXPECT_NEAR(l.z(), f.z(), 0.01 * kWeight);
  EXPECT_NEAR(l.x() + f.x(), 0, 0.01 * kWeight);
  Settle::Request bad;
  bad.time = -1;
  EXPECT_FALSE(call<Settle>("settle", bad).success);
}

TEST_F(SceneInput, GravityAndDampingHoldFromTheNextFrameOnUntilReset) {
  ASSERT_TRUE(settle(5).at_rest);
  geometry_msgs::Vector3 gravity;
  gravity.y = 4.905;
  send("gravity", gravity);
  ASSERT_TRUE(settle(5).at_rest);
  Vec3 sum = force(left_) + force(right_);
  EXPECT_NEAR(sum.y(), 0.5 * kWeight, 0.01 * kWeight);
  EXPECT_NEAR(sum.z(), 0, 0.01 * kWeight);
  gravity.y = NAN;
  send("gravity", gravity);
  sum = force(left_) + force(right_);
  EXPECT_NEAR(sum.y(), 0.5 * kWeight, 0.01 * kWeight) << "a gravity that is none is not taken";
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  ASSERT_TRUE(wait_until([&] { return inputs.connected(); }));
  std_msgs::Float64 damping;
  damping.data = 7;
  send("damping", damping);
  step(1);
  ASSERT_TRUE(wait_until([&] { return inputs.count() > 0; }));
  EXPECT_EQ(inputs.all().back()->damping, 7);
  EXPECT_EQ(inputs.all().back()->gravity.y, 4.905);
  trigger("reset");
  ASSERT_TRUE(settle(5).at_rest);
  sum = force(left_) + force(right_);
  EXPECT_NEAR(sum.z(), -kWeight, 0.01 * kWeight) << "the scene's again";
}

TEST_F(SceneInput, AnAnchorFollowsItsPosesAndTellsWhatItPulls) {
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  ASSERT_TRUE(wait_until([&] { return inputs.connected(); }));
  geometry_msgs::PoseStamped pose;
  pose.pose.orientation.w = 1;
  pose.pose.position.z = 0.01;
  for (int i = 1; i <= 8; ++i) {  // a tenth of the length
    pose.pose.position.x = 0.02 + 0.0004 * i;
    send("anchors/right/measured_cp", pose);
    step(1);
    ASSERT_TRUE(wait_until([&] { return inputs.count() >= static_cast<std::size_t>(i); }));
    ASSERT_EQ(inputs.all().back()->anchors.size(), 2u) << i;
    EXPECT_NEAR(inputs.all().back()->anchors[1].end.position.x, pose.pose.position.x, 1e-9) << i;
  }
  ASSERT_TRUE(settle(5).at_rest);
  const double pull = force(left_).x();
  EXPECT_NEAR(pull, -force(right_).x(), 0.01 * pull);
  // Between E A e, a little less where it narrows, and a tenth more for its ends that do not.
  EXPECT_GT(pull, 0.9 * 1e4 * 4e-4 * 0.1);
  EXPECT_LT(pull, 1.2 * 1e4 * 4e-4 * 0.1);
  ASSERT_TRUE(wait_until([&] { return clouds.count() > 0; }));
  const auto held_moved = [&] {
    double most = 0;
    int held = 0;
    for (const Carried& c : carried(*clouds.all().back())) {
      if (c.rest.x() < 0.0175) continue;
      ++held;
      most = std::max(most, (c.displacement - Vec3(0.0032, 0, 0)).norm());
    }
    return held > 50 ? most : 1.0;
  };
  EXPECT_TRUE(wait_until([&] { return held_moved() < 1e-5; })) << held_moved();
  // One that is farther than an arm may move in a frame is not taken.
  pose.pose.position.x = 0.5;
  send("anchors/right/measured_cp", pose);
  EXPECT_NEAR(force(left_).x(), pull, 0.01 * pull);
  // After a reset it is where the scene has it, and follows from there.
  trigger("reset");
  ASSERT_TRUE(settle(5).at_rest);
  EXPECT_NEAR(force(left_).x(), -force(right_).x(), 0.01 * kWeight);
  EXPECT_LT(std::fabs(force(left_).x()), 0.5 * pull);
}

TEST_F(SceneInput, CloudsCarryTheFieldsThatWereAskedFor) {
  ASSERT_TRUE(settle(5).at_rest);
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  const auto c = clouds.next();
  ASSERT_TRUE(c);
  ASSERT_EQ(c->point_step, static_cast<unsigned>(kEach));
  std::string fields;
  for (std::size_t i = 8; i < c->fields.size(); ++i) {
    fields += c->fields[i].name + std::to_string(c->fields[i].offset) + " ";
  }
  EXPECT_EQ(fields,
            "rest_x32 rest_y36 rest_z40 ux44 uy48 uz52 vx56 vy60 vz64 volume68 sxx72 syy76 szz80 "
            "sxy84 syz88 szx92 ");
  double volume = 0, shear_left = 0, shear_right = 0, lowest = 0;
  std::size_t i = 0;
  for (const Carried& p : carried(*c)) {
    Point at;
    std::memcpy(&at, &c->data[kEach * i++], sizeof at);
    ASSERT_NEAR((p.rest + p.displacement - Vec3(at.x, at.y, at.z)).norm(), 0, 1e-6);
    ASSERT_LT(p.velocity.norm(), 1e-3);
    volume += p.volume;
    lowest = std::min(lowest, p.displacement.z());
    (p.rest.x() < 0 ? shear_left : shear_right) += p.volume * p.stress[5];
  }
  EXPECT_NEAR(volume, 16e-6, 1e-9);
  EXPECT_LT(lowest, -1e-4) << "it sags";
  EXPECT_LT(shear_left * shear_right, 0) << "each half hangs from its own end";
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("scene_input_test")
