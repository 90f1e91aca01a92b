// What a grasper presses with: squeezed, set while it runs, and run again.
#include "tools/grip.h"

#include <gtest/gtest.h>

#include "support/cut_scenes.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

Pose pointing_down(double z) {
  return {Vec3(0, 0, z), Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()))};
}

/// A block of 8 x 12 x 20 mm on the ground, above the origin, and a grasper.
Scene block_on_ground() {
  Scene scene = free_box(Vec3(0.008, 0.012, 0.02), 0.002);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.01);
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  Material m;
  m.name = "test";
  m.young_modulus = 2e4;
  m.viscosity = 5;
  scene.materials = {m};
  scene.bodies[0].material = "test";
  Tool t;
  t.name = "grasper";
  t.type = ToolType::kGrasper;
  t.friction = 1;
  t.grip_pressure = 2000;
  scene.tools = {t};
  scene.device = Device::kCpu;
  return scene;
}

double pressed(const FrameReport& report) {
  const ToolLoad& load = report.result.loads[0];
  return load.grip_area > 0 ? load.grip / load.grip_area : 0;
}

TEST(Squeeze, GrowsBelowZeroUpToThreeTimes) {
  EXPECT_EQ(squeezed(2000, 1), 2000);
  EXPECT_EQ(squeezed(2000, 0), 2000);
  EXPECT_NEAR(squeezed(2000, -kFullSqueeze / 2), 4000, 1e-9);
  EXPECT_EQ(squeezed(2000, -kFullSqueeze), 6000);
  EXPECT_EQ(squeezed(2000, -3), 6000);
}

TEST(Squeeze, HoldsHarderWhatIsBetweenTheJaws) {
  Simulation simulation(block_on_ground());
  FrameReport report;
  const auto hold = [&](double jaw, int frames) {
    for (int f = 0; f < frames; ++f) {
      simulation.set_tool(0, pointing_down(0.012), jaw);
      report = simulation.advance_frame();
    }
    return pressed(report);
  };
  hold(1.8, 6);
  EXPECT_NEAR(hold(0, 60), 2000, 200);
  EXPECT_NEAR(hold(-kFullSqueeze / 2, 40), 4000, 400);
  EXPECT_GT(report.input.tools[0].jaw_end, 0) << "the block is between them";
  EXPECT_NEAR(report.input.grip_pressures[0], 4000, 1e-3);
  EXPECT_NEAR(hold(0, 40), 2000, 200) << "and less again";
  simulation.set_grip_pressure(0, 3000);
  EXPECT_NEAR(hold(0, 40), 3000, 300);
  EXPECT_THROW(simulation.set_grip_pressure(0, -1), std::invalid_argument);
  EXPECT_THROW(simulation.set_grip_pressure(0, 1e9), std::invalid_argument);
  EXPECT_THROW(simulation.set_grip_pressure(1, 3000), std::invalid_argument);
}

TEST(Squeeze, IsRunAgainWithTheSameBits) {
  Simulation simulation(block_on_ground());
  std::vector<AppliedInput> inputs;
  for (int f = 0; f < 50; ++f) {
    simulation.set_tool(0, pointing_down(0.012), f < 5 ? 1.8 : 0.6 - 0.02 * f);
    if (f == 30) simulation.set_grip_pressure(0, 3000);
    inputs.push_back(simulation.advance_frame().input);
  }
  Simulation again(block_on_ground());
  for (const AppliedInput& input : inputs) {
    EXPECT_EQ(again.repeat_frame(input).input.grip_pressures, input.grip_pressures);
  }
  EXPECT_EQ(again.tissue().checksum(), simulation.tissue().checksum());
}

}  // namespace
}  // namespace tissue_sim
