// Each topic of the node.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr int kPoints = 8 * 4 * 4 * 8;  // of the slab: cells times points a cell

Pose pointing_down(double x, double y, double z) {
  return {Vec3(x, y, z), Quat(0, 1, 0, 0)};  // half a turn about x
}

class Topics : public testing::Test {
 protected:
  void SetUp() override {
    pause(false);
    trigger("reset");
  }
};

TEST_F(Topics, StateSaysHowTheSimulationStands) {
  Topic<SimulationState> state("/simulator/state");
  const auto s = state.next();
  ASSERT_TRUE(s);
  EXPECT_EQ(s->header.frame_id, "world");
  EXPECT_EQ(s->particles, kPoints);
  EXPECT_EQ(s->fragments, 1);
  EXPECT_EQ(s->loose_fragments, 0);
  EXPECT_NEAR(s->fragment_volume, 16e-6, 1e-9);
  EXPECT_GT(s->substeps, 0);
  EXPECT_NEAR(s->time, s->frame / 60.0, 1e-9);
  EXPECT_FALSE(s->device.empty());
  EXPECT_NE(s->checksum, 0u);
}

TEST_F(Topics, StateTellsTheLongestSubstepOfAFrame) {
  Topic<SimulationState> state("/simulator/state");
  const auto beyond_frame = [](const auto& s) { return s->substep * s->substeps - 1.0 / 60; };
  // Most frames have equal substeps; in some they grow or shrink little by little.
  EXPECT_TRUE(wait_until(
      [&] {
        const auto all = state.all();
        return std::any_of(all.begin(), all.end(),
                           [&](const auto& s) { return std::fabs(beyond_frame(s)) < 1e-9; });
      },
      20));
  for (const auto& s : state.all()) EXPECT_GT(beyond_frame(s), -1e-9) << "frame " << s->frame;
}

TEST_F(Topics, WallTimeIsKeptAndNeverCaughtUp) {
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.count() > 150; }, 60));
  const auto all = state.all();
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_EQ(all[i]->frame, all[i - 1]->frame + 1);
  const auto &a = all[20], &b = all[140];
  const double wall = (b->header.stamp - a->header.stamp).toSec();
  const double factor = (b->time - a->time) / wall;
  EXPECT_LT(factor, 1.03);
  EXPECT_NEAR(b->real_time_factor, factor, 0.35);  // it looks at the last second alone
}

TEST_F(Topics, CloudHasTheDocumentedLayout) {
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  const auto c = clouds.next();
  ASSERT_TRUE(c);
  EXPECT_EQ(c->header.frame_id, "world");
  ASSERT_EQ(c->point_step, 32u);
  ASSERT_EQ(c->width * c->height, static_cast<unsigned>(kPoints));
  ASSERT_EQ(c->data.size(), 32u * kPoints);
  std::string fields;
  for (const auto& f : c->fields) fields += f.name + std::to_string(f.offset) + " ";
  EXPECT_EQ(fields, "x0 y4 z8 rgb12 id16 fragment20 stress24 damage28 ");
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; i < kPoints; ++i) {
    Point p;
    std::memcpy(&p, &c->data[32 * i], sizeof p);
    ids.insert(p.id);
    ASSERT_TRUE(std::isfinite(p.stress));
    ASSERT_LT(std::fabs(p.x), 0.022);
    ASSERT_LT(std::fabs(p.y), 0.012);
    ASSERT_GT(p.z, -0.002);
    ASSERT_LT(p.z, 0.022);
    ASSERT_EQ(p.fragment, 0);
    ASSERT_EQ(p.damage, 0);
  }
  EXPECT_EQ(ids.size(), static_cast<std::size_t>(kPoints));
}

TEST_F(Topics, FragmentsAndSceneAreThere) {
  Topic<FragmentArray> fragments("/simulator/fragments");
  const auto f = fragments.next();
  ASSERT_TRUE(f);
  ASSERT_EQ(f->fragments.size(), 1u);
  EXPECT_EQ(f->fragments[0].body, "slab");
  EXPECT_EQ(f->fragments[0].point_count, kPoints);
  EXPECT_NEAR(f->fragments[0].volume, 16e-6, 1e-9);
  EXPECT_NEAR(f->fragments[0].centroid.x, 0, 1e-3);
  EXPECT_NEAR(f->fragments[0].centroid.z, 0.01, 2e-3);
  EXPECT_NEAR(f->fragments[0].box_max.x - f->fragments[0].box_min.x, 0.0375, 3e-3);

  Topic<std_msgs::String> scenes("/simulator/scene");  // latched
  const auto s = scenes.last();
  ASSERT_TRUE(s);
  const Scene scene = scene_from_yaml(s->data);
  EXPECT_EQ(scene.name, "slab");
  EXPECT_EQ(scene.tools.size(), 5u);
}

TEST_F(Topics, PosesInAnyFrameMoveTheTool) {
  tf2_ros::StaticTransformBroadcaster broadcaster;
  geometry_msgs::TransformStamped t;
  t.header.frame_id = "world";
  t.child_frame_id = "arm";
  t.transform = to_transform({Vec3(0.3, 0, 0.1), Quat(std::sqrt(0.5), 0, 0, std::sqrt(0.5))});
  t.header.stamp = ros::Time::now();
  broadcaster.sendTransform(t);
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Arm arm("probe");
  const auto at = [&](const Vec3& x) {
    return [&inputs, x] {
      const auto m = inputs.last();
      return m && m->tools[1].present && (from_message(m->tools[1].end).position - x).norm() < 1e-9;
    };
  };
  // Until the node knows the frame, poses in it are refused: so send until one gets through.
  EXPECT_TRUE(wait_until([&] {
    arm.send(pointing_down(0.01, 0.02, 0.03), "arm");
    ros::WallDuration(0.02).sleep();
    return at(Vec3(0.28, 0.01, 0.13))();  // a quarter turn about z, then the shift
  }));
  const Quat turned = from_message(inputs.last()->tools[1].end).orientation;
  EXPECT_NEAR(turned.angularDistance(Quat(0, std::sqrt(0.5), std::sqrt(0.5), 0)), 0, 1e-6);
  arm.send({Vec3(0.27, 0, 0.1), turned});
  EXPECT_TRUE(wait_until(at(Vec3(0.27, 0, 0.1)))) << "an empty frame is the world";
  arm.send({Vec3(0.26, 0, 0.1), turned}, "world");
  EXPECT_TRUE(wait_until(at(Vec3(0.26, 0, 0.1))));
  const auto m = inputs.last();
  ASSERT_EQ(m->tools.size(), 5u);
  EXPECT_EQ(m->tools[1].name, "probe");
}

TEST_F(Topics, ToolsFollowTfOrTransformsWhereAsked) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  tf2_ros::TransformBroadcaster broadcaster;
  ros::NodeHandle node;
  ros::Publisher transforms =
      node.advertise<geometry_msgs::TransformStamped>("/simulator/needle/measured_cp", 10);
  ASSERT_TRUE(wait_until([&] { return transforms.getNumSubscribers() > 0; }));
  EXPECT_TRUE(wait_until([&] {
    geometry_msgs::TransformStamped t;
    t.header.frame_id = "world";
    t.header.stamp = ros::Time::now();
    t.child_frame_id = "hook_tip";  // the parameter tools/hook/tf_frame
    t.transform = to_transform(pointing_down(-0.1, 0, 0.2));
    broadcaster.sendTransform(t);
    t.transform = to_transform(pointing_down(0, 0.1, 0.2));
    transforms.publish(t);
    ros::WallDuration(0.02).sleep();
    const auto m = inputs.last();
    return m && m->tools[2].present && m->tools[3].present;
  }));
  const auto m = inputs.last();
  EXPECT_NEAR(m->tools[2].end.position.x, -0.1, 1e-9);
  EXPECT_NEAR(m->tools[3].end.position.y, 0.1, 1e-9);
}

TEST_F(Topics, JawAnglesArePassedOn) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/probe/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  Arm arm("probe");
  EXPECT_TRUE(wait_until([&] {
    sensor_msgs::JointState jaw;
    jaw.header.stamp = ros::Time::now();
    jaw.name = {"jaw"};
    jaw.position = {0.25};
    jaws.publish(jaw);
    arm.send(pointing_down(0.26, 0, 0.1));
    ros::WallDuration(0.02).sleep();
    const auto m = inputs.last();
    return m && std::fabs(m->tools[1].jaw_end - 0.25) < 1e-6;
  }));
}

TEST_F(Topics, JawsOfAGrasperCloseAsFastAsAMotor) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Topic<visualization_msgs::MarkerArray> markers("/simulator/markers");
  ros::NodeHandle node;
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/grasper/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return jaws.getNumSubscribers() > 0; }));
  Arm arm("grasper");
  const auto jaw_is = [&](double angle) {
    return wait_until([&] {
      sensor_msgs::JointState jaw;
      jaw.header.stamp = ros::Time::now();
      jaw.position = {angle};
      jaws.publish(jaw);
      arm.send(pointing_down(-0.2, 0, 0.1));
      ros::WallDuration(0.01).sleep();
      const auto m = inputs.last();
      if (m && m->tools[4].present) {
        EXPECT_LT(std::fabs(m->tools[4].jaw_end - m->tools[4].jaw_begin), 3.0 / 60 + 1e-6);
      }
      return m && std::fabs(m->tools[4].jaw_end - angle) < 1e-6;
    });
  };
  EXPECT_TRUE(jaw_is(0.9));
  EXPECT_TRUE(jaw_is(0));
  EXPECT_TRUE(wait_until([&] {
    const auto array = markers.last();
    return array && std::count_if(
                        array->markers.begin(), array->markers.end(),
                        [](const visualization_msgs::Marker& m) { return m.ns == "grasper"; }) == 3;
  }));
}

TEST_F(Topics, WrenchPushesBackAndTurnsWithTheTool) {
  Topic<geometry_msgs::WrenchStamped> spatial("/simulator/probe/spatial/measured_cf");
  Topic<geometry_msgs::WrenchStamped> body("/simulator/probe/body/measured_cf");
  Topic<visualization_msgs::MarkerArray> markers("/simulator/markers");
  Arm arm("probe");
  const Pose above = pointing_down(0.01, 0, 0.04), pressed = pointing_down(0.01, 0, 0.016);
  ASSERT_TRUE(wait_until([&] {  // wherever the test before left it
    arm.send(above);
    ros::WallDuration(0.02).sleep();
    return spatial.count() > 3;
  }));
  ros::WallDuration(0.3).sleep();
  EXPECT_EQ(spatial.last()->wrench.force.z, 0) << "in the air";
  arm.sweep(above, pressed, 0.8);
  ASSERT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z > 0.01; }))
      << "the tissue pushes the probe up";
  ASSERT_TRUE(body.last());
  EXPECT_EQ(body.last()->header.frame_id, "probe");
  EXPECT_EQ(spatial.last()->header.frame_id, "world");
  // Pairs of the same frame: the body's z points down.
  bool paired = false;
  for (const auto& s : spatial.all()) {
    for (const auto& b : body.all()) {
      if (s->header.stamp != b->header.stamp || s->wrench.force.z < 0.01) continue;
      paired = true;
      ASSERT_NEAR(b->wrench.force.z, -s->wrench.force.z, 1e-9);
      ASSERT_NEAR(b->wrench.force.x, s->wrench.force.x, 1e-9);
      ASSERT_NEAR(b->wrench.force.y, -s->wrench.force.y, 1e-9);
    }
  }
  EXPECT_TRUE(paired);
  const auto m = markers.next();
  ASSERT_TRUE(m);
  std::set<std::string> shown;
  for (const auto& marker : m->markers) {
    if (marker.action == visualization_msgs::Marker::ADD) shown.insert(marker.ns);
  }
  EXPECT_TRUE(shown.count("probe"));
  EXPECT_TRUE(shown.count("probe/force"));
  EXPECT_TRUE(shown.count("fragments/box"));
  arm.sweep(pressed, above, 0.3);
}

TEST_F(Topics, ToolsAreInTf) {
  tf2_ros::Buffer buffer;
  tf2_ros::TransformListener listener(buffer);
  Arm arm("probe");
  EXPECT_TRUE(wait_until([&] {
    arm.send(pointing_down(0.02, 0.01, 0.05));
    ros::WallDuration(0.02).sleep();
    if (!buffer.canTransform("world", "probe", ros::Time(0))) return false;
    const auto t = buffer.lookupTransform("world", "probe", ros::Time(0)).transform.translation;
    return std::fabs(t.x - 0.02) < 1e-9 && std::fabs(t.z - 0.05) < 1e-9;
  }));
}

TEST_F(Topics, DiagnosticsComesOnceASecond) {
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ASSERT_TRUE(wait_until([&] {
    std::set<std::string> names;
    for (const auto& m : diagnostics.all()) {
      for (const auto& s : m->status) names.insert(s.name);
    }
    return names.count("simulator: simulation") && names.count("simulator: tools") &&
           names.count("simulator: recording");
  }));
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("topics_test")
