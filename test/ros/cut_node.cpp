// Cuts end to end: by a scalpel that is driven over its topic, and by the service.
#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <cstring>
#include <limits>
#include <map>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr double kVolume = 16e-6;  // of the slab [m^3]

std::vector<Point> points_of(const sensor_msgs::PointCloud2& cloud) {
  std::vector<Point> points(cloud.data.size() / sizeof(Point));
  std::memcpy(points.data(), cloud.data.data(), cloud.data.size());
  return points;
}

class CutTest : public testing::Test {
 protected:
  void SetUp() override {
    pause(true);
    trigger("reset");
    step(1);
  }

  // Which piece each material point belongs to.
  std::map<std::uint32_t, Point> cloud() {
    step(1);
    std::map<std::uint32_t, Point> points;
    const auto c = clouds_.next();
    if (!c) return points;
    for (const Point& p : points_of(*c)) points[p.id] = p;
    return points;
  }
  FragmentArray fragments() {
    step(1);
    const auto m = fragments_.next();
    return m ? *m : FragmentArray();
  }

  // Two halves at the plane x = 0, midway between two layers of points.
  void expect_halves(const std::map<std::uint32_t, Point>& before) {
    const FragmentArray pieces = fragments();
    ASSERT_EQ(pieces.fragments.size(), 2u);
    const TissueFragment &held = pieces.fragments[0], &loose = pieces.fragments[1];
    EXPECT_EQ(held.id, 0);
    EXPECT_EQ(held.parent, -1);
    EXPECT_FALSE(held.loose);
    EXPECT_EQ(loose.id, 1);
    EXPECT_EQ(loose.parent, 0);
    EXPECT_TRUE(loose.loose);
    EXPECT_NEAR(held.volume, kVolume / 2, 1e-3 * kVolume);
    EXPECT_NEAR(loose.volume, kVolume / 2, 1e-3 * kVolume);
    EXPECT_NEAR(held.volume + loose.volume, kVolume, 1e-6 * kVolume);
    EXPECT_EQ(held.point_count + loose.point_count, 1024);
    EXPECT_LT(held.centroid.x, loose.centroid.x);
    const std::map<std::uint32_t, Point> after = cloud();
    ASSERT_EQ(after.size(), before.size());
    int damaged = 0;
    for (const auto& p : after) {
      ASSERT_EQ(p.second.fragment, before.at(p.first).x < 0 ? 0 : 1);
      damaged += p.second.damage > 0;
    }
    EXPECT_GT(damaged, 0);
    EXPECT_LT(damaged, 600) << "only points next to the cut";
  }

  Topic<sensor_msgs::PointCloud2> clouds_{"/simulator/tissue/points"};
  Topic<FragmentArray> fragments_{"/simulator/fragments"};
};

TEST_F(CutTest, ServiceCutsInTwo) {
  const auto before = cloud();
  ASSERT_EQ(before.size(), 1024u);
  const Cut::Response reply = call<Cut>("cut", plane_cut(0));
  ASSERT_TRUE(reply.success) << reply.message;
  EXPECT_GT(reply.points_separated, 100);
  ASSERT_EQ(reply.new_fragments.size(), 1u);
  EXPECT_EQ(reply.new_fragments[0], 1);
  expect_halves(before);

  const Cut::Response again = call<Cut>("cut", plane_cut(0));
  EXPECT_FALSE(again.success) << "it is cut already";
}

TEST_F(CutTest, LoosePointsHaveTheirOwnCloud) {
  Topic<sensor_msgs::PointCloud2> loose("/simulator/fragments/points");
  ASSERT_TRUE(loose.next());
  EXPECT_EQ(loose.last()->width, 0u);
  ASSERT_TRUE(call<Cut>("cut", plane_cut(0)).success);
  step(1);
  ASSERT_TRUE(loose.next());
  ASSERT_EQ(loose.last()->width, 512u);
  for (const Point& p : points_of(*loose.last())) ASSERT_EQ(p.fragment, 1);
}

TEST_F(CutTest, ScalpelCutsInTwo) {
  const auto before = cloud();
  Arm scalpel("scalpel");
  const Pose from = blade_pose(0, -0.025, -0.004), to = blade_pose(0, 0.025, -0.004);
  pause(false);
  ros::WallDuration(0.3).sleep();
  // Wherever a test before left it, it must not cut on its way here.
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  ASSERT_TRUE(wait_until([&] {
    scalpel.send(from);
    ros::WallDuration(0.02).sleep();
    const auto m = inputs.last();
    return m && m->tools[0].present &&
           (from_message(m->tools[0].begin).position - from.position).norm() < 1e-9;
  }));
  scalpel.sweep(from, to, 1.0);
  Topic<SimulationState> state("/simulator/state");
  EXPECT_TRUE(wait_until([&] { return state.count() > 0 && state.last()->fragments == 2; }));
  pause(true);
  expect_halves(before);
}

TEST_F(CutTest, HalfWayItStaysOnePiece) {
  Cut::Request half = plane_cut(0);
  half.path[1] = to_pose(blade_pose(0, 0.0, -0.01));
  const Cut::Response reply = call<Cut>("cut", half);
  ASSERT_TRUE(reply.success) << reply.message;
  EXPECT_GT(reply.points_separated, 0);
  EXPECT_TRUE(reply.new_fragments.empty());
  EXPECT_EQ(fragments().fragments.size(), 1u);
}

TEST_F(CutTest, NewPiecesAreSaidInTheFrameThatMadeThem) {
  Topic<FrameInputMessage> inputs("/simulator/inputs");
  pause(false);
  ASSERT_TRUE(inputs.next());
  const auto made_by = [&](double x, std::size_t pieces) {
    ASSERT_TRUE(call<Cut>("cut", plane_cut(x)).success);
    boost::shared_ptr<const FragmentArray> said;  // the first that lists as many
    ASSERT_TRUE(wait_until([&] {
      for (const auto& m : fragments_.all()) {
        if (!said && m->fragments.size() == pieces) said = m;
      }
      return said != nullptr;
    }));
    const auto frame_of_cut = [&]() -> std::int64_t {
      const auto all = inputs.all();
      for (auto m = all.rbegin(); m != all.rend(); ++m) {
        if (!(*m)->cuts.empty()) return (*m)->frame;
      }
      return -1;
    };
    ASSERT_TRUE(wait_until([&] { return frame_of_cut() + 1 >= std::int64_t(said->frame); }));
    EXPECT_EQ(frame_of_cut() + 1, std::int64_t(said->frame)) << "a frame later or more";
  };
  made_by(0.001, 2);
  made_by(0.009, 3);  // cut again: the piece that came off
  pause(true);
  const FragmentArray pieces = fragments();
  ASSERT_EQ(pieces.fragments.size(), 3u);
  EXPECT_EQ(pieces.fragments[1].parent, pieces.fragments[0].id);
  EXPECT_EQ(pieces.fragments[2].parent, pieces.fragments[1].id);
}

TEST_F(CutTest, TwoCutsGiveThreePiecesWhoseVolumesAddUp) {
  ASSERT_TRUE(call<Cut>("cut", plane_cut(-0.009)).success);
  ASSERT_TRUE(call<Cut>("cut", plane_cut(0.011)).success);
  const FragmentArray pieces = fragments();
  ASSERT_EQ(pieces.fragments.size(), 3u);
  double sum = 0;
  for (const auto& f : pieces.fragments) sum += f.volume;
  EXPECT_NEAR(sum, kVolume, 1e-6 * kVolume);
  // The largest part keeps the id: the middle, half of it. The ends are a quarter each.
  EXPECT_NEAR(pieces.fragments[0].volume, kVolume / 2, 1e-3 * kVolume);
  EXPECT_NEAR(pieces.fragments[1].volume, kVolume / 4, 1e-3 * kVolume);
  EXPECT_NEAR(pieces.fragments[2].volume, kVolume / 4, 1e-3 * kVolume);
}

TEST_F(CutTest, PathMayBeInAnyFrame) {
  tf2_ros::StaticTransformBroadcaster broadcaster;
  geometry_msgs::TransformStamped t;
  t.header.stamp = ros::Time::now();
  t.header.frame_id = "world";
  t.child_frame_id = "camera";
  t.transform = to_transform({Vec3(0.5, 0.2, 0.1), Quat::Identity()});
  broadcaster.sendTransform(t);
  const auto before = cloud();
  Cut::Request request = plane_cut(0);
  request.header.frame_id = "camera";
  for (auto& pose : request.path) {
    pose.position.x -= 0.5, pose.position.y -= 0.2, pose.position.z -= 0.1;
  }
  Cut::Response reply;
  ASSERT_TRUE(wait_until([&] { return (reply = call<Cut>("cut", request)).success; }, 5))
      << reply.message;
  expect_halves(before);
}

TEST_F(CutTest, WhatCannotBeMeantIsRefused) {
  const auto refused = [](const Cut::Request& request, const std::string& reason) {
    const Cut::Response reply = call<Cut>("cut", request);
    EXPECT_FALSE(reply.success);
    EXPECT_NE(reply.message.find(reason), std::string::npos) << reply.message;
    EXPECT_EQ(reply.points_separated, 0);
  };
  refused(plane_cut(0.5), "misses the tissue");
  Cut::Request one_pose = plane_cut(0);
  one_pose.path.pop_back();
  refused(one_pose, "at least 2");
  Cut::Request one_point = plane_cut(0);
  one_point.edge.pop_back();
  refused(one_point, "at least 2");
  Cut::Request nan = plane_cut(0);
  nan.path[1].position.y = std::numeric_limits<double>::quiet_NaN();
  refused(nan, "path[1] is not finite");
  Cut::Request infinite = plane_cut(0);
  infinite.edge[0].x = std::numeric_limits<double>::infinity();
  refused(infinite, "edge[0] is not finite");
  Cut::Request turned = plane_cut(0);
  turned.path[0].orientation.w = 3;
  refused(turned, "path[0] has a quaternion");
  Cut::Request lost = plane_cut(0);
  lost.header.frame_id = "nowhere";
  refused(lost, "nowhere");
  EXPECT_EQ(fragments().fragments.size(), 1u);
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("cut_test")
