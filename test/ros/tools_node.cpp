// Tools: where their poses and jaws come from, what pushes them, how they are shown.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

Pose pointing_down(double x, double y, double z) {
  return {Vec3(x, y, z), Quat(0, 1, 0, 0)};  // half a turn about x
}

class Tools : public testing::Test {
 protected:
  void SetUp() override {
    pause(false);
    trigger("reset");
  }
};

TEST_F(Tools, PosesInAnyFrameMoveTheTool) {
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

TEST_F(Tools, ToolsFollowTfOrTransformsWhereAsked) {
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

// Whoever publishes them hears of it from roscpp; whoever subscribed would not.
TEST_F(Tools, TransformsWhereNoneAreAskedForAreRefusedWithTheReason) {
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ros::NodeHandle node;
  ros::Publisher transforms =
      node.advertise<geometry_msgs::TransformStamped>("/simulator/scalpel/measured_cp", 10);
  EXPECT_TRUE(wait_until([&] {
    for (const auto& message : diagnostics.all()) {
      for (const auto& status : message->status) {
        if (status.message.find("set tools/scalpel/pose_type: TransformStamped") !=
            std::string::npos) {
          return true;
        }
      }
    }
    return false;
  }));
}

TEST_F(Tools, JawAnglesArePassedOn) {
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

TEST_F(Tools, OfTheJointsOfAnArmTheOneCalledJawIsTakenAndOthersAreRefusedOnce) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Topic<rosgraph_msgs::Log> log("/rosout");
  ros::NodeHandle node;
  ros::Publisher joints =
      node.advertise<sensor_msgs::JointState>("/simulator/probe/jaw/measured_js", 10);
  ASSERT_TRUE(wait_until([&] { return joints.getNumSubscribers() > 0; }));
  Arm arm("probe");
  ASSERT_TRUE(wait_until([&] {  // what it says is heard: what follows it says once
    arm.send(pointing_down(NAN, 0, 0));
    ros::WallDuration(0.02).sleep();
    const auto all = log.all();
    return std::any_of(all.begin(), all.end(),
                       [](const auto& line) { return line->name == "/simulator"; });
  }));
  sensor_msgs::JointState m;
  const auto jaw_after_sending = [&] {
    m.header.stamp = ros::Time::now();
    joints.publish(m);
    arm.send(pointing_down(0.26, 0, 0.1));
    ros::WallDuration(0.02).sleep();
    return inputs.last() ? inputs.last()->tools[1].jaw_end : NAN;
  };
  m.position.assign(15, 0.7);
  m.name.assign(15, "joint");
  m.name[6] = "jaw";
  m.position[6] = 0.4;
  EXPECT_TRUE(wait_until([&] { return std::fabs(jaw_after_sending() - 0.4) < 1e-6; }));
  m.name.clear();  // as a Raven II sends them
  const auto said = [&] {
    const auto all = log.all();
    return std::count_if(all.begin(), all.end(), [](const rosgraph_msgs::Log::ConstPtr& line) {
      return line->msg.find("15 joints without names") != std::string::npos;
    });
  };
  EXPECT_TRUE(wait_until([&] {
    EXPECT_NEAR(jaw_after_sending(), 0.4, 1e-6);
    return said() > 0;
  }));
  const ros::WallTime then = ros::WallTime::now();
  while (ros::WallTime::now() - then < ros::WallDuration(2.5)) jaw_after_sending();
  EXPECT_EQ(said(), 1);
}

TEST_F(Tools, JawsOfAGrasperCloseAsFastAsAMotor) {
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

TEST_F(Tools, WrenchPushesBackAndTurnsWithTheTool) {
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

TEST_F(Tools, ForcesAndTransformsGoOnWhilePausedAndPushNobody) {
  Topic<geometry_msgs::WrenchStamped> spatial("/simulator/probe/spatial/measured_cf");
  Topic<tf2_msgs::TFMessage> tf("/tf");
  Arm arm("probe");
  const Pose above = pointing_down(0.01, 0, 0.04), pressed = pointing_down(0.01, 0, 0.016);
  arm.send(above);
  arm.sweep(above, pressed, 0.8);
  ASSERT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z > 0.01 && tf.count() > 3; }));
  pause(true);
  ros::WallDuration(0.1).sleep();  // what was under way
  const auto last = spatial.last();
  const std::size_t forces = spatial.count(), transforms = tf.count();
  EXPECT_TRUE(wait_until([&] { return spatial.count() > forces + 10; }, 2));
  EXPECT_TRUE(wait_until([&] { return tf.count() > transforms + 10; }, 2));
  EXPECT_GT(spatial.last()->header.stamp, last->header.stamp);
  EXPECT_EQ(spatial.last()->wrench.force.z, 0);
  pause(false);
  EXPECT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z > 0.01; }));
}

TEST_F(Tools, AnArmThatVanishesIsPushedByNothing) {
  Topic<geometry_msgs::WrenchStamped> spatial("/simulator/probe/spatial/measured_cf");
  {
    Arm arm("probe");
    const Pose above = pointing_down(0.01, 0, 0.04), pressed = pointing_down(0.01, 0, 0.016);
    arm.send(above);
    arm.sweep(above, pressed, 0.8);
    ASSERT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z > 0.01; }));
  }
  EXPECT_TRUE(wait_until([&] { return spatial.last()->wrench.force.z == 0; }));
}

TEST_F(Tools, AfterAResetTheFirstPoseCountsWhateverItsStamp) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Arm arm("probe");
  ASSERT_TRUE(wait_until([&] {
    arm.send(pointing_down(0.01, 0, 0.05));
    ros::WallDuration(0.02).sleep();
    return inputs.count() > 0 && inputs.last()->tools[1].present;
  }));
  trigger("reset");
  const Pose begin = pointing_down(0.31, 0, 0.07);  // of a trajectory that begins anew
  arm.send(begin, "", ros::Time::now() - ros::Duration(100));
  EXPECT_TRUE(wait_until(
      [&] {
        return (from_message(inputs.last()->tools[1].end).position - begin.position).norm() < 1e-9;
      },
      3));
}

TEST_F(Tools, GripIsSaidAndItsPressureSetWhileItRuns) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  Topic<JawGrip> grips("/simulator/grasper/grip");
  ros::NodeHandle node;
  ros::Publisher pressure =
      node.advertise<std_msgs::Float64>("/simulator/grasper/grip_pressure", 10);
  ros::Publisher jaws =
      node.advertise<sensor_msgs::JointState>("/simulator/grasper/jaw/measured_js", 10);
  ASSERT_TRUE(
      wait_until([&] { return pressure.getNumSubscribers() > 0 && jaws.getNumSubscribers() > 0; }));
  Arm arm("grasper");
  const auto limit_is = [&](double set, double jaw, double expected) {
    return wait_until([&] {
      std_msgs::Float64 p;
      p.data = set;
      pressure.publish(p);
      sensor_msgs::JointState j;
      j.position = {jaw};
      jaws.publish(j);
      arm.send(pointing_down(0.2, 0.2, 0.1));
      ros::WallDuration(0.02).sleep();
      return grips.count() > 0 &&
             std::fabs(grips.last()->pressure_limit - expected) < 1e-3 * expected &&
             std::fabs(inputs.last()->tools[4].grip_pressure - expected) < 1e-3 * expected;
    });
  };
  EXPECT_TRUE(limit_is(0, 0.3, 3000)) << "the scene's";
  EXPECT_TRUE(limit_is(5000, 0.3, 5000));
  EXPECT_TRUE(limit_is(5000, -0.175, 10000)) << "half squeezed";
  EXPECT_TRUE(limit_is(5000, -2, 15000)) << "and no more than three times";
  EXPECT_TRUE(limit_is(5000, 60, 15000)) << "degrees are refused";
  EXPECT_EQ(grips.last()->header.frame_id, "grasper");
  EXPECT_EQ(grips.last()->pressure, 0) << "in the air";
  EXPECT_TRUE(limit_is(0, 0, 3000));
}

TEST_F(Tools, ToolsAreInTf) {
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

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("tools_test")
