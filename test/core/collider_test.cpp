// Colliders: how deep places lie in them, and how far from touching they are.
#include "tools/collider.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tissue_sim/types.h"

namespace tissue_sim {
namespace {

std::mt19937 rng(7);

float uniform(float from, float to) { return std::uniform_real_distribution<float>(from, to)(rng); }

Vec3 random_vector(float size) {
  return Vec3(uniform(-size, size), uniform(-size, size), uniform(-size, size));
}

Collider random_collider(Collider::Kind kind) {
  Collider c;
  c.kind = kind;
  c.length = uniform(0.02f, 0.05f);
  c.radius = uniform(0.001f, 0.005f);
  c.width = uniform(0.004f, 0.01f);
  c.thickness = uniform(0.0005f, 0.002f);
  const Quat q = Quat(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized();
  const Eigen::Matrix3d r = q.toRotationMatrix();
  const Vec3 tip = random_vector(0.01f);
  for (int i = 0; i < 9; ++i) c.rotation[i] = static_cast<float>(r(i / 3, i % 3));
  for (int a = 0; a < 3; ++a) c.position[a] = static_cast<float>(tip[a]);
  return c;
}

/// Distance of a place from a collider, 0 or less inside.
double distance(const Collider& c, const Vec3& place) {
  Eigen::Matrix3d to_world;
  for (int i = 0; i < 9; ++i) to_world(i / 3, i % 3) = c.rotation[i];
  const Vec3 tip(c.position[0], c.position[1], c.position[2]);
  const Vec3 at = to_world.transpose() * (place - tip);
  if (c.kind == Collider::kPlane) return at[2];
  if (c.kind == Collider::kCapsule) {
    const Vec3 axis(0, 0, std::clamp<double>(at[2], -c.length, -c.radius));
    return (at - axis).norm() - c.radius;
  }
  if (c.kind == Collider::kJaw) {  // at most on its face, where it is a strip with a round end
    const Vec3 axis(0, 0, std::clamp<double>(at[2], -c.length, -c.radius));
    if (at[0] <= 0) return (at - axis).norm() - c.radius;
    return std::hypot(at[0], std::max(0.0, std::hypot(at[1], at[2] - axis[2]) - c.radius));
  }
  const Vec3 lowest(-c.width, -0.5 * c.thickness, -c.length), highest(0, 0.5 * c.thickness, 0);
  return (at - at.cwiseMax(lowest).cwiseMin(highest)).norm();
}

/// A blade's is the largest of the distances along its three axes.
TEST(Clearance, IsNoMoreThanTheDistanceAndNotMuchLess) {
  for (const auto kind : {Collider::kPlane, Collider::kCapsule, Collider::kJaw, Collider::kBlade}) {
    int free = 0;
    for (int i = 0; i < 2000; ++i) {
      const Collider c = random_collider(kind);
      const Vec3 place = random_vector(0.03f);
      const float x[3] = {static_cast<float>(place[0]), static_cast<float>(place[1]),
                          static_cast<float>(place[2])};
      const double far = distance(c, place);
      if (far <= 1e-7) {
        EXPECT_LT(clearance(c, x), 1e-6) << kind;
        continue;
      }
      ++free;
      EXPECT_LT(clearance(c, x), far + 1e-7) << kind;
      EXPECT_GT(clearance(c, x), far / std::sqrt(3) - 1e-7) << kind;
      EXPECT_GT(gap(c, x).distance, 0) << kind;
    }
    EXPECT_GT(free, 500) << kind;
  }
}

}  // namespace
}  // namespace tissue_sim
