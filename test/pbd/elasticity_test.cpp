// Bodies of elastic tetrahedra that are far from rest.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pbd/pbd_tissue.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

/// A cube of tetrahedra, 5 cm long, to whose vertices something is done.
template <class Change>
double volume_after_two_seconds(const Change& change) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.device = Device::kCpu;  // whose vertices are moved below
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.cell_size = 0.01;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  scene.damping = 3;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.05, 0.05, 0.05);
  Simulation simulation(scene);
  pbd::State& s = static_cast<PbdTissue&>(simulation.tissue()).state();
  for (int i = 0; i < s.vertices.size(); ++i) {
    const Vec3 x = change(s.vertices.position(i));
    for (int a = 0; a < 3; ++a) s.vertices.x[4 * i + a] = static_cast<float>(x[a]);
  }
  for (int f = 0; f < 120; ++f) {
    if (simulation.advance_frame().result.blew_up) return std::nan("");
  }
  double volume = 0;
  for (const pbd::Tetrahedron& t : s.tetrahedra) {
    const Vec3 o = s.vertices.position(t[0]);
    volume += (s.vertices.position(t[1]) - o)
                  .cross(s.vertices.position(t[2]) - o)
                  .dot(s.vertices.position(t[3]) - o) /
              6;
  }
  return volume;
}

TEST(Elasticity, AFlattenedCubeRises) {
  EXPECT_NEAR(volume_after_two_seconds([](const Vec3& x) {
                return Vec3(x.x(), x.y(), 0.02 * x.z());
              }) / 1.25e-4,
              1, 0.02);
}

TEST(Elasticity, ATornUpCubeMends) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> aside(-0.008, 0.008);  // edges are 10 mm
  EXPECT_NEAR(volume_after_two_seconds([&](const Vec3& x) {
                return Vec3(x + Vec3(aside(random), aside(random), aside(random)));
              }) / 1.25e-4,
              1, 0.02);
}

// It may end inside out, but not anywhere.
TEST(Elasticity, ChaosDoesNotBlowUp) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-0.02, 0.02);
  EXPECT_TRUE(std::isfinite(volume_after_two_seconds(
      [&](const Vec3&) { return Vec3(within(random), within(random), within(random)); })));
}

}  // namespace
}  // namespace tissue_sim
