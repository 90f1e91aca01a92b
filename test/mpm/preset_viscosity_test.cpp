// Presets are as viscous as it takes to come to rest, and fall as freely as ever.
#include <gtest/gtest.h>

#include <algorithm>

#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

// README's ball in coarser cells.
Scene ball_of_gelatine() {
  Scene scene;
  scene.device = Device::kCpu;
  scene.cell_size = 0.005;
  scene.bodies.resize(1);
  Body& ball = scene.bodies[0];
  ball.shape = Shape::kBall;
  ball.radius = 0.025;
  ball.pose.position = Vec3(0, 0, 0.025);
  ball.material = "gelatine";
  return scene;
}

TEST(PresetViscosity, ABallThatIsLetGoComesToRestInFourSeconds) {
  Simulation simulation(ball_of_gelatine());
  double most = 0, last = 0;
  for (int frame = 0; frame < 240; ++frame) {
    const double energy = simulation.advance_frame().result.kinetic_energy;
    most = std::max(most, energy);
    if (frame >= 225) last = std::max(last, energy);  // it swings some times a second
  }
  EXPECT_GT(most, 5e-4) << "it sinks onto the ground at first";
  EXPECT_LT(last, 0.02 * most) << "0.008; without viscosity 0.46";
}

TEST(PresetViscosity, TakesNothingOfFreeFall) {
  Scene scene = ball_of_gelatine();
  scene.ground.enabled = false;
  Simulation simulation(scene);
  for (int frame = 0; frame < 18; ++frame) simulation.advance_frame();
  const Fragment& ball = simulation.tissue().fragments()[0];
  EXPECT_NEAR(ball.velocity.z(), -9.81 * 0.3, 1e-4);
  EXPECT_NEAR(ball.velocity.head<2>().norm(), 0, 1e-5);
}

}  // namespace
}  // namespace tissue_sim
