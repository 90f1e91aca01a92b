// Distances to a punch and a plate, whose edges are rounded, against rounded shapes sampled finely.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tools/collider.h"

namespace tissue_sim {
namespace {

/// A punch of radius 6 and length 20 mm, a plate of 12 x 8 x 4 mm, edges of 1 mm; at the origin.
Collider collider(Collider::Kind kind) {
  Collider c;
  c.kind = kind;
  c.radius = 0.006f;
  c.edge = 0.001f;
  c.width = 0.012f;
  c.thickness = 0.008f;
  c.length = kind == Collider::kPunch ? 0.02f : 0.004f;
  return c;
}

/// Distance from the shape within the edges, whose points are all that are within the edge's radius
/// of it [m].
double distance(const Collider& c, const float* x) {
  const double z = std::max({0.0, x[2] + double(c.edge), -c.length + double(c.edge) - x[2]});
  const double out2 = z * z;
  if (c.kind == Collider::kPunch) {
    const double r = std::max<double>(0, std::hypot(x[0], x[1]) - (c.radius - c.edge));
    return std::sqrt(out2 + r * r) - c.edge;
  }
  const double dx = std::max<double>(0, std::fabs(x[0]) - (c.width / 2 - c.edge));
  const double dy = std::max<double>(0, std::fabs(x[1]) - (c.thickness / 2 - c.edge));
  return std::sqrt(out2 + dx * dx + dy * dy) - c.edge;
}

TEST(RoundedCollider, HasTheDistancesAndNormalsOfItsShape) {
  for (const Collider::Kind kind : {Collider::kPunch, Collider::kPlate}) {
    const Collider c = collider(kind);
    std::mt19937 random(1);
    std::uniform_real_distribution<float> place(-0.012f, 0.012f);
    int beyond = 0;
    for (int i = 0; i < 5000; ++i) {
      float x[3] = {place(random), place(random), place(random)};
      const Gap g = gap(c, x);
      const double expected = distance(c, x);
      const float length = std::sqrt(g.normal[0] * g.normal[0] + g.normal[1] * g.normal[1] +
                                     g.normal[2] * g.normal[2]);
      ASSERT_NEAR(length, 1, 1e-5);
      if (expected <=
          -c.edge + 1e-9) {  // deeper than the edges reach: at least as deep as they are
        EXPECT_LE(g.distance, -c.edge + 1e-6f);
        continue;
      }
      ++beyond;
      ASSERT_NEAR(g.distance, expected, 1e-6);
      float on[3];  // the place on the surface below has no distance
      for (int a = 0; a < 3; ++a) on[a] = x[a] - g.distance * g.normal[a];
      ASSERT_NEAR(gap(c, on).distance, 0, 1e-6);
    }
    EXPECT_GT(beyond, 1000);
  }
}

TEST(RoundedCollider, PressesWithItsFace) {
  for (const Collider::Kind kind : {Collider::kPunch, Collider::kPlate}) {
    const float under[3] = {0.001f, -0.0005f, 0.0003f};
    const Gap g = gap(collider(kind), under);
    EXPECT_NEAR(g.distance, 0.0003, 1e-8);
    EXPECT_EQ(g.normal[2], 1);
  }
}

}  // namespace
}  // namespace tissue_sim
