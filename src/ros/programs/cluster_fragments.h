// What PCL makes of the node's clouds: clusters of loose fragments, the plane of a cut.
#pragma once

#include "tissue_sim/pcl_point.h"
// The point comes first.
#include <pcl/ModelCoefficients.h>
#include <pcl/point_cloud.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>
#include <pcl/segmentation/sac_segmentation.h>

#include <vector>

namespace tissue_sim {

using PclCloud = pcl::PointCloud<PclPoint>;

/// Points within `tolerance` [m] of one another belong together; largest cluster first.
inline std::vector<pcl::PointIndices> clusters_of(const PclCloud::ConstPtr& cloud,
                                                  double tolerance) {
  std::vector<pcl::PointIndices> clusters;
  if (cloud->empty()) return clusters;
  pcl::search::KdTree<PclPoint>::Ptr tree(new pcl::search::KdTree<PclPoint>);
  tree->setInputCloud(cloud);
  pcl::EuclideanClusterExtraction<PclPoint> extraction;
  extraction.setClusterTolerance(tolerance);
  extraction.setSearchMethod(tree);
  extraction.setInputCloud(cloud);
  extraction.extract(clusters);
  return clusters;
}

/// The plane a x + b y + c z + d = 0 that most points lie at, within `tolerance` [m], of those
/// whose bonds a cut broke; no coefficients where there is none. `at`, if given, becomes their
/// indices.
inline pcl::ModelCoefficients cut_plane(const PclCloud::ConstPtr& cloud, double tolerance,
                                        pcl::PointIndices* at = nullptr) {
  pcl::PointIndices::Ptr broken(new pcl::PointIndices);
  for (std::size_t i = 0; i < cloud->size(); ++i) {
    if (cloud->points[i].damage > 0) broken->indices.push_back(static_cast<int>(i));
  }
  pcl::ModelCoefficients plane;
  if (broken->indices.size() < 3) return plane;
  pcl::SACSegmentation<PclPoint> segmentation;
  segmentation.setOptimizeCoefficients(true);
  segmentation.setModelType(pcl::SACMODEL_PLANE);
  segmentation.setMethodType(pcl::SAC_RANSAC);
  segmentation.setDistanceThreshold(tolerance);
  segmentation.setInputCloud(cloud);
  segmentation.setIndices(broken);
  pcl::PointIndices inliers;
  segmentation.segment(inliers, plane);
  if (at != nullptr) *at = inliers;
  return plane;
}

}  // namespace tissue_sim
