// The cells around points that lost bonds, against brute force.
#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "mpm/split/node_fields.h"
#include "support/cut_scenes.h"

namespace tissue_sim {
namespace {

TEST(CellsAround, AreThoseWithinReachOfAnyPoint) {
  Scene scene = free_box(Vec3(0.031, 0.023, 0.017), 0.002);
  scene.bodies[0].shape = Shape::kEllipsoid;
  scene.bodies[0].radii = Vec3(0.015, 0.011, 0.008);
  scene.bodies.push_back(
      scene.bodies[0]);  // a second one, whose points come after those of the first
  scene.bodies[1].pose.position += Vec3(0.1, 0, 0);
  MpmTissue tissue(scene);
  const MpmState& s = tissue.state();
  std::mt19937 random(3);
  for (const int how_many : {0, 1, 2, 40}) {
    std::vector<std::int32_t> some;
    for (int i = 0; i < how_many; ++i) some.push_back(random() % s.points.size());
    for (int reach = 1; reach <= 2; ++reach) {
      std::set<int> expected, found;
      for (std::size_t b = 0; b < s.bodies.size(); ++b) {
        s.bodies[b].for_each_node([&](int node, int x, int y, int z) {
          for (const std::int32_t p : some) {
            const Points::Site& at = s.points.site[p];
            if (at.body != static_cast<int>(b) || std::abs(at.x / 2 - x) > reach ||
                std::abs(at.y / 2 - y) > reach || std::abs(at.z / 2 - z) > reach) {
              continue;
            }
            expected.insert(node);
          }
        });
        int last = -1;
        CellsAround(s.bodies[b], reach, s.points, some)
            .for_each_row([&](int x, int y, int z, int node, const std::uint8_t* near, int count) {
              EXPECT_GT(node, last);
              last = node + count - 1;
              EXPECT_EQ(s.bodies[b].node(x, y, z), node);
              for (int i = 0; i < count; ++i) {
                if (near[i] != 0) found.insert(node + i);
              }
            });
      }
      EXPECT_EQ(found, expected) << how_many << " points, reach " << reach;
    }
  }
}

}  // namespace
}  // namespace tissue_sim
