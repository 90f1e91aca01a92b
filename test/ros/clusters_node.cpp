// The example of perception, cluster_fragments, beside a running node: what it prints of a cut is
// what the node says of it.
#include <rosgraph_msgs/Log.h>
#include <tissue_sim/LoadScene.h>

#include <cmath>
#include <cstdio>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

struct Cluster {
  int points = 0, fragment = -1;
  Vec3 middle;
};

TEST(Clusters, AreTheLooseFragmentsAndThePlaneIsTheCuts) {
  Topic<rosgraph_msgs::Log> log("/rosout");
  Topic<FragmentArray> fragments("/simulator/fragments");
  LoadScene::Request scene;  // a bar that is held in its middle
  scene.yaml =
      "{cell_size: 0.002, gravity: [0, 0, 0], ground: {enabled: false}, bodies: [{size: [0.04, "
      "0.01, 0.01], anchors: [{ball: {center: [0, 0, 0], radius: 0.004}}]}]}";
  const auto loaded = call<LoadScene>("load_scene", scene);
  ASSERT_TRUE(loaded.success) << loaded.message;
  for (const double x : {-0.01, 0.01}) ASSERT_TRUE(call<Cut>("cut", plane_cut(x)).success);

  // Until what it printed last of each agrees: messages of before are on their way.
  std::vector<TissueFragment> loose;
  std::vector<Cluster> clusters;
  Eigen::Vector4f plane;
  const auto agree = [&] {
    loose.clear();
    clusters.clear();
    plane.setZero();
    if (fragments.count() > 0) {
      for (const TissueFragment& f : fragments.last()->fragments) {
        if (f.loose) loose.push_back(f);
      }
    }
    for (const auto& line : log.all()) {
      Cluster c;
      Eigen::Vector4f p;
      int points;
      if (std::sscanf(line->msg.c_str(), "loose: %d points about (%lf, %lf, %lf) m, fragment %d",
                      &c.points, &c.middle.x(), &c.middle.y(), &c.middle.z(), &c.fragment) == 5) {
        clusters.push_back(c);
        if (clusters.size() > 2) clusters.erase(clusters.begin());
      } else if (std::sscanf(line->msg.c_str(), "cut: %d points at %f x + %f y + %f z + %f = 0",
                             &points, &p[0], &p[1], &p[2], &p[3]) == 5) {
        plane = p;
      }
    }
    if (loose.size() != 2 || clusters.size() != 2) return false;
    for (const TissueFragment& f : loose) {
      bool found = false;
      for (const Cluster& c : clusters) {
        found = found || (c.fragment == f.id && c.points == static_cast<int>(f.point_count) &&
                          (c.middle - from_message(f.centroid)).norm() < 1e-3);
      }
      if (!found) return false;
    }
    return std::fabs(plane[0]) > 0.999 && std::fabs(std::fabs(plane[3]) - 0.01) < 5e-4;
  };
  EXPECT_TRUE(wait_until(agree)) << loose.size() << " loose fragments, " << clusters.size()
                                 << " clusters, plane " << plane.transpose();
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("clusters_test")
