// The pieces of a cut against clusters that the Point Cloud Library finds in space.
#include <gtest/gtest.h>

#include <iostream>
#include <map>

#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

#ifdef TISSUE_SIM_HAS_PCL
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>
#endif

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.03, 0.02);
constexpr double kCell = 0.002;
constexpr std::size_t kSmall = 4;  ///< clusters of fewer points are listed

#ifdef TISSUE_SIM_HAS_PCL

/// The cluster of each point: points within a lattice spacing (and a hundredth, for rounding) of
/// one another belong together.
std::vector<int> clusters(const std::vector<Vec3>& places) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const Vec3& x : places) {
    cloud->push_back(pcl::PointXYZ(float(x.x()), float(x.y()), float(x.z())));
  }
  pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>);
  tree->setInputCloud(cloud);
  pcl::EuclideanClusterExtraction<pcl::PointXYZ> extraction;
  extraction.setClusterTolerance(1.01 * kCell / 2);
  extraction.setMinClusterSize(1);
  extraction.setMaxClusterSize(static_cast<int>(places.size()));
  extraction.setSearchMethod(tree);
  extraction.setInputCloud(cloud);
  std::vector<pcl::PointIndices> found;
  extraction.extract(found);
  std::vector<int> cluster(places.size(), -1);
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const auto p : found[i].indices) cluster[p] = static_cast<int>(i);
  }
  return in_order(cluster);
}

/// Prints the pieces of less than 4 points and returns how many there are.
int list_small(const std::string& name, const std::vector<int>& piece) {
  std::map<int, std::size_t> size;
  for (const int p : piece) ++size[p];
  int count = 0;
  for (const auto& [id, points] : size) {
    if (points >= kSmall) continue;
    if (count++ == 0) std::cout << name << ": small pieces (points)";
    std::cout << " " << id << " (" << points << ")";
  }
  if (count > 0) std::cout << std::endl;
  return count;
}

TEST(CutClusters, AreThePiecesOfEveryKindOfCut) {
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    MpmTissue tissue(free_box(kSize, kCell));
    // Moved by the cut's true surface, whatever the program thinks is a piece.
    std::vector<Vec3> places = positions(tissue);
    for (Vec3& x : places) x.z() += kind.part(x) * (kSize.z() + 5 * kCell);
    for (const BladePath& path : kind.cuts) cut_now(tissue, path);
    EXPECT_EQ(labels(tissue), clusters(places));
    EXPECT_EQ(list_small(kind.name, labels(tissue)), 0);
  }
}

TEST(CutClusters, AreTheDebrisOfNineRandomPlanes) {
  MpmTissue tissue(free_box(kSize, kCell));
  std::vector<Vec3> places = positions(tissue);
  std::vector<unsigned> sides(places.size(), 0);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 9; ++i) {
    const Vec3 normal(u(random), u(random), u(random));
    const Vec3 place =
        0.5 * kSize + 0.3 * Vec3(u(random), u(random), u(random)).cwiseProduct(kSize);
    for (std::size_t p = 0; p < places.size(); ++p) {
      sides[p] |= unsigned((places[p] - place).dot(normal) > 0) << i;
    }
    cut_now(tissue, plane_cut(place, normal));
  }
  std::map<unsigned, int> part;
  for (std::size_t p = 0; p < places.size(); ++p) {
    const int i = part.try_emplace(sides[p], static_cast<int>(part.size())).first->second;
    places[p].z() += i * (kSize.z() + 5 * kCell);
  }
  EXPECT_GT(tissue.fragments().size(), 50u);
  EXPECT_EQ(labels(tissue), clusters(places));
  RecordProperty("small_clusters", list_small("nine planes", labels(tissue)));
}

/// Throws every point away from the planes that it lies beside, and lets the body fly.
TEST(CutClusters, AreThePiecesThatFlyApart) {
  const Vec3 place = Vec3(0.487, 0.513, 0.461).cwiseProduct(kSize);
  const Vec3 normals[] = {{1, 0.2, 0}, {-0.2, 1, 0.1}, {0, 0.1, 1}};
  for (int planes = 1; planes <= 3; ++planes) {
    SCOPED_TRACE(planes);
    MpmTissue tissue(free_box(kSize, kCell));
    MpmState& s = tissue.state();
    const std::vector<Vec3> before = positions(tissue);
    for (int i = 0; i < planes; ++i) cut_now(tissue, plane_cut(place, normals[i]));
    constexpr double kSpeed = 1;
    std::vector<Vec3> velocity, pushed(s.nodes.size(), Vec3::Zero());
    std::vector<double> mass(s.nodes.size(), 0.0);
    for (std::size_t p = 0; p < before.size(); ++p) {
      Vec3 v = Vec3::Zero();
      for (int i = 0; i < planes; ++i) {
        v += ((before[p] - place).dot(normals[i]) > 0 ? kSpeed : -kSpeed) * normals[i];
      }
      velocity.push_back(v);
      for (int k = 0; k < 27; ++k) {
        const Points::Site& site = s.points.site[p];
        const int n = s.fields->node(s.bodies[0], site, k);
        pushed[n] += site_weight(site, k) * v;
        mass[n] += site_weight(site, k);
      }
    }
    for (std::size_t n = 0; n < mass.size(); ++n) {
      for (int a = 0; a < 3 && mass[n] > 0; ++a) {
        s.nodes.v[a][n] = static_cast<float>(pushed[n][a] / mass[n]);
      }
    }
    const double gap = 5 * kCell, time = gap / (2 * kSpeed);
    const int substeps = static_cast<int>(std::ceil(time / tissue.stable_substep()));
    advance_by(tissue, substeps, static_cast<float>(time / substeps), {});
    ASSERT_FALSE(tissue.finish().blew_up);
    const std::vector<Vec3> after = positions(tissue);
    for (std::size_t p = 0; p < after.size(); ++p) {
      ASSERT_LT((after[p] - before[p] - time * velocity[p]).norm(), 1e-6) << "held back: " << p;
    }
    EXPECT_EQ(labels(tissue), clusters(after));
    EXPECT_EQ(tissue.fragments().size(), 1u << planes);
  }
}

#else

TEST(CutClusters, NeedThePointCloudLibrary) {
  GTEST_SKIP() << "not built with PCL (apt-get install libpcl-dev): the pieces are not compared "
                  "with Euclidean clusters";
}

#endif

}  // namespace
}  // namespace tissue_sim
