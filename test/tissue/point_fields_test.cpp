// What points carry behind their Point agrees with the rest of what a tissue tells.
#include <gtest/gtest.h>

#include <cstring>

#include "support/cut_paths.h"
#include "support/test_meshes.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class PointFieldsOf : public EachMethod {};

TEST_P(PointFieldsOf, AgreeWithPlacesPiecesAndMomentum) {
  Scene scene = on_this(free_box(Vec3(0.04, 0.03, 0.02), 0.003));
  scene.gravity = Vec3(1, 0, -4);
  Simulation simulation(scene);
  simulation.cut(upright_blade({Vec3(0.001, -0.1, 0), Vec3(0.002, 0.1, 0)}));
  for (int f = 0; f < 4; ++f) simulation.advance_frame();
  Tissue& tissue = simulation.tissue();
  PointSelection selection;
  selection.fields = kRestPosition | kDisplacement | kVelocity | kVolume;
  const std::size_t size = selection.point_size();
  ASSERT_EQ(size, sizeof(Point) + 10 * sizeof(float));
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points(selection, cloud);
  ASSERT_EQ(count, tissue.point_count());
  ASSERT_EQ(cloud.size(), size * count);
  const std::vector<Point> plain = points_of(tissue);
  const double density = find_material(scene, scene.bodies[0].material).density;
  double volume = 0;
  Vec3 momentum = Vec3::Zero();
  for (int i = 0; i < count; ++i) {
    Point p;
    float f[10];
    std::memcpy(&p, &cloud[i * size], sizeof(Point));
    std::memcpy(f, &cloud[i * size + sizeof(Point)], sizeof f);
    ASSERT_EQ(std::memcmp(&p, &plain.at(p.id), sizeof(Point)), 0);
    EXPECT_NEAR(f[0] + f[3], p.x, 1e-7);
    EXPECT_NEAR(f[1] + f[4], p.y, 1e-7);
    EXPECT_NEAR(f[2] + f[5], p.z, 1e-7);
    momentum += density * f[9] * Vec3(f[6], f[7], f[8]);
    volume += f[9];
  }
  EXPECT_NEAR(volume, 0.04 * 0.03 * 0.02, 0.01 * volume);
  const Vec3 whole = tissue.momentum().linear;
  EXPECT_GT(whole.norm(), 0);
  EXPECT_LT((momentum - whole).norm(), 1e-4 * whole.norm());
  // What a method has not is refused, never memory of something else.
  selection.fields = kStressTensor;
  if (tissue.point_fields() & kStressTensor) {
    EXPECT_EQ(tissue.read_points(selection, cloud), count);
    EXPECT_EQ(cloud.size(), selection.point_size() * count);
  } else {
    EXPECT_THROW(tissue.read_points(selection, cloud), std::invalid_argument);
  }
}

FOR_EACH_METHOD(PointFieldsOf);

}  // namespace
}  // namespace tissue_sim
