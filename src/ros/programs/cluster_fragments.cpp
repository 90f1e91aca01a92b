// An example of perception with PCL: clusters what is loose, and fits a plane to where tissue was
// cut, by the clouds of a running simulator.
//   rosrun tissue_sim cluster_fragments _tolerance:=0.003
#include "ros/programs/cluster_fragments.h"

#include <pcl/common/centroid.h>
#include <pcl_conversions/pcl_conversions.h>
#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>

namespace {

tissue_sim::PclCloud::Ptr received(const sensor_msgs::PointCloud2& message) {
  tissue_sim::PclCloud::Ptr cloud(new tissue_sim::PclCloud);
  pcl::fromROSMsg(message, *cloud);
  return cloud;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "cluster_fragments");
  ros::NodeHandle node;
  const double tolerance = ros::NodeHandle("~").param("tolerance", 0.003);  // [m], a cell or so
  const ros::Subscriber loose = node.subscribe<sensor_msgs::PointCloud2>(
      "simulator/fragments/points", 1, [=](const sensor_msgs::PointCloud2::ConstPtr& message) {
        const auto cloud = received(*message);
        for (const pcl::PointIndices& cluster : tissue_sim::clusters_of(cloud, tolerance)) {
          Eigen::Vector4f middle;
          pcl::compute3DCentroid(*cloud, cluster.indices, middle);
          ROS_INFO("loose: %zu points about (%.4f, %.4f, %.4f) m, fragment %d",
                   cluster.indices.size(), middle.x(), middle.y(), middle.z(),
                   cloud->points[cluster.indices[0]].fragment);
        }
      });
  const ros::Subscriber tissue = node.subscribe<sensor_msgs::PointCloud2>(
      "simulator/tissue/points", 1, [=](const sensor_msgs::PointCloud2::ConstPtr& message) {
        pcl::PointIndices at;
        const auto plane = tissue_sim::cut_plane(received(*message), tolerance / 2, &at).values;
        if (plane.empty()) return;
        ROS_INFO("cut: %zu points at %.3f x + %.3f y + %.3f z + %.4f = 0", at.indices.size(),
                 plane[0], plane[1], plane[2], plane[3]);
      });
  ros::spin();
}
