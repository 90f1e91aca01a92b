// The node's clouds, as PCL reads them.
#include <gtest/gtest.h>
#ifdef TISSUE_SIM_HAS_PCL
#include "ros/programs/cluster_fragments.h"
// The point comes first.
#include <pcl_conversions/pcl_conversions.h>

#include <cstring>
#include <map>
#include <memory>

#include "ros/conversions.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

/// A bar that is held in the middle, both ends of which are cut off at 10 mm from it.
std::unique_ptr<Simulation> cut_bar() {
  Scene scene;
  scene.device = Device::kCpu;
  scene.cell_size = 0.002;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.01, 0.01);
  Region region;
  region.kind = Region::Kind::kBall;
  region.radius = 0.004;
  scene.bodies[0].anchors = {region};
  auto simulation = std::make_unique<Simulation>(scene);
  for (const double x : {-0.01, 0.01}) {
    BladePath path;
    path.edge = {Vec3(0, 0, -0.02), Vec3(0, 0, 0.02)};
    path.poses.resize(2);
    path.poses[0].position = Vec3(x, -0.02, 0);
    path.poses[1].position = Vec3(x, 0.02, 0);
    simulation->cut(path);
  }
  simulation->advance_frame();
  return simulation;
}

/// As the node publishes them.
sensor_msgs::PointCloud2 message_of(Tissue& tissue, const PointSelection& selection) {
  sensor_msgs::PointCloud2 message;
  const int count = tissue.read_points(selection, message.data);
  describe_points(count, selection.fields, message);
  return message;
}

TEST(Pcl, ReadsEachFieldOfTheClouds) {
  const auto simulation = cut_bar();
  for (const bool loose_only : {false, true}) {
    for (const unsigned fields : {0u, unsigned(kVelocity | kVolume)}) {
      PointSelection selection;
      selection.loose_only = loose_only;
      selection.fields = fields;
      const sensor_msgs::PointCloud2 message = message_of(simulation->tissue(), selection);
      PclCloud cloud;
      pcl::fromROSMsg(message, cloud);
      ASSERT_EQ(cloud.size(), message.width);
      ASSERT_GT(cloud.size(), 100u);
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        Point p;
        std::memcpy(&p, &message.data[i * message.point_step], sizeof p);
        const PclPoint& q = cloud.points[i];
        ASSERT_EQ(p.x, q.x);
        ASSERT_EQ(p.y, q.y);
        ASSERT_EQ(p.z, q.z);
        ASSERT_EQ(p.rgb, q.rgba & 0xFFFFFF);
        ASSERT_EQ(p.id, q.id);
        ASSERT_EQ(p.fragment, q.fragment);
        ASSERT_EQ(p.stress, q.stress);
        ASSERT_EQ(p.damage, q.damage);
      }
    }
  }
}

TEST(Pcl, ClustersLooseFragmentsAndFindsThePlaneOfACut) {
  const auto simulation = cut_bar();
  PointSelection loose;
  loose.loose_only = true;
  PclCloud::Ptr cloud(new PclCloud);
  pcl::fromROSMsg(message_of(simulation->tissue(), loose), *cloud);
  const auto clusters = clusters_of(cloud, 0.002);
  EXPECT_EQ(clusters.size(), 2u);
  std::map<int, int> size_of;
  for (const Fragment& f : simulation->tissue().fragments()) {
    if (f.loose) size_of[f.id] = f.point_count;
  }
  EXPECT_EQ(size_of.size(), 2u);
  for (const pcl::PointIndices& cluster : clusters) {
    const int id = cloud->points[cluster.indices[0]].fragment;
    EXPECT_EQ(static_cast<int>(cluster.indices.size()), size_of[id]);
    for (const auto i : cluster.indices) EXPECT_EQ(cloud->points[i].fragment, id);
  }
  pcl::fromROSMsg(message_of(simulation->tissue(), {}), *cloud);
  pcl::PointIndices at;
  const auto plane = cut_plane(cloud, 0.001, &at).values;
  ASSERT_EQ(plane.size(), 4u);
  EXPECT_NEAR(std::abs(plane[0]), 1, 1e-3);
  EXPECT_NEAR(std::abs(plane[3]), 0.01, 5e-4);
  EXPECT_GE(at.indices.size(), 2 * 10u * 10u);  // a layer of points on each side
}

}  // namespace
}  // namespace tissue_sim
#else
TEST(Pcl, IsNeeded) {
  GTEST_SKIP() << "not built with PCL (apt-get install libpcl-conversions-dev): its reading of "
                  "clouds is not tested";
}
#endif
