// Forces, clamps and frequencies against finite elements (test/data/references.yaml), set up as a
// user does: cell sizes that do not divide the body, planes anywhere in a cell;
// docs/validation.md has finer cells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "scene/scene_text.h"
#include "support/finite_element_scenes.h"
#include "support/measured.h"
#include "tissue_sim/simulation.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#endif

namespace tissue_sim {
namespace {

const char* const kData = TISSUE_SIM_TEST_DATA;

/// A value over that of finite elements, less 1.
double error(double value, const char* body, const char* name) {
  return value / reference(kData, body, name) - 1;
}

Tool ball(double radius) {
  Tool t;
  t.name = "ball";
  t.type = ToolType::kBall;
  t.radius = radius;
  t.friction = 0;
  return t;
}

Tool punch() {
  Tool t;
  t.name = "punch";
  t.type = ToolType::kPunch;
  t.radius = 0.006;
  t.edge_radius = 0.001;
  t.length = 0.05;
  t.friction = 0;
  return t;
}

class FiniteElementsOn : public testing::TestWithParam<Device> {
 protected:
  void SetUp() override {
#if defined(TISSUE_SIM_CUDA)
    const std::string why = GetParam() == Device::kCuda ? why_no_gpu() : "";
    if (!why.empty()) GTEST_SKIP() << why;
#endif
  }
  static Scene on_this(Scene scene) {
    scene.device = GetParam();
    return scene;
  }
};
std::string name_of_device(const testing::TestParamInfo<Device>& info) {
  return name_of(info.param, kDeviceNames);
}
#if defined(TISSUE_SIM_CUDA)
INSTANTIATE_TEST_SUITE_P(Devices, FiniteElementsOn, testing::Values(Device::kCpu, Device::kCuda),
                         name_of_device);
#else
INSTANTIATE_TEST_SUITE_P(Devices, FiniteElementsOn, testing::Values(Device::kCpu), name_of_device);
#endif

double force_error(double cell_size, const Tool& tool, double depth, const char* body,
                   const char* name, Device device) {
  Scene scene = indented_cylinder(cell_size, 0, tool);
  scene.device = device;
  Simulation simulation(scene);
  const double e = error(indentation_force(simulation, depth), body, name);
  std::printf("%s at %g mm cells: %+.4f\n", name, 1e3 * cell_size, e);
  return e;
}

/// How far the middle of the top sinks, and what the clamp carries.
double sag_error(const Scene& scene) {
  const double cell_size = scene.cell_size;
  const double held = scene.bodies[0].size.z() - 0.032;
  Simulation simulation(scene);
  const SettleReport report = simulation.settle({1e-4, 3, 20});
  EXPECT_TRUE(report.at_rest) << held << ": " << report.speed << " m/s";
  const Vec3 top(0, 0, 0.032);
  const double sag = -surface_displacement(simulation.tissue(), 2, top, 2, 0.002 + 1.5 * cell_size);
  const double weight = 9.81 * 1000 * 0.04 * 0.04 * 0.032;
  const Vec3 force = simulation.advance_frame().result.anchor_loads[0].force;
  EXPECT_TRUE(is_at_most("what the clamp carries, off the weight",
                         (force + Vec3(0, 0, weight)).norm() / weight, 0.01, "%"))
      << held;
  return error(sag, "block", "sag");
}

// A round tip that is pressed in: 1.8 cells in the contact's radius, then three.
TEST_P(FiniteElementsOn, ForceOnARoundTool) {
  EXPECT_TRUE(is_within("ball of 10 mm, 2 mm deep, cells of 2.5 mm",
                        force_error(0.0025, ball(0.01), 0.002, "ball", "force_2mm", GetParam()),
                        0.04));
  EXPECT_TRUE(is_within("the same, 6 mm deep",
                        force_error(0.0025, ball(0.01), 0.006, "ball", "force_6mm", GetParam()),
                        0.04));
}

TEST_P(FiniteElementsOn, ForceOnAToolAsLargeAsACell) {
  EXPECT_TRUE(is_within(
      "ball of 3 mm, 2 mm deep, cells of 3 mm",
      force_error(0.003, ball(0.003), 0.002, "small_ball", "force_2mm", GetParam()), 0.2));
}

TEST_P(FiniteElementsOn, ForceOnAFlatTool) {
  const double coarse = force_error(0.003, punch(), 0.001, "punch", "force_1mm", GetParam());
  const double fine = force_error(0.002, punch(), 0.001, "punch", "force_1mm", GetParam());
  EXPECT_TRUE(is_within("flat punch of 6 mm, 1 mm deep, cells of 3 mm", coarse, 0.08));
  EXPECT_TRUE(is_within("the same, cells of 2 mm", fine, 0.03));
  EXPECT_TRUE(
      is_at_least("the first over the second", std::fabs(coarse / fine), std::pow(1.5, 1.3)));
}

TEST_P(FiniteElementsOn, SagOfAClampedBlockWhereverThePlaneLiesInACell) {
  const auto sag_error_of = [](double cell_size, double held) {
    return sag_error(on_this(clamped_block(cell_size, held)));
  };
  double least = 1, most = -1;
  for (const double held : {0.0, 0.001, 0.0036, 0.0041, 0.0087, 0.0099, 0.01, 0.0111}) {
    const double e = sag_error_of(0.004, held);
    EXPECT_TRUE(is_within("sag of a clamped block, plane anywhere in its cell", e, 0.015)) << held;
    least = std::min(least, e);
    most = std::max(most, e);
  }
  EXPECT_LT(most - least, 0.015);
  EXPECT_TRUE(is_within("the same, cells that do not divide the block",
                        sag_error_of(0.0037, 0.0083), 0.015));
  EXPECT_TRUE(is_at_least("its error at 8 mm over that at 4",
                          std::fabs(sag_error_of(0.008, 0) / sag_error_of(0.004, 0)),
                          std::pow(2, 1.3)));
}

TEST_P(FiniteElementsOn, FrequencyOfAClampedBlock) {
  for (const bool sideways : {true, false}) {
    Scene scene = on_this(clamped_block(0.004, 0.009));
    scene.frame_rate = 400;
    Simulation simulation(scene);
    const int axis = sideways ? 0 : 2;
    const Vec3 top(0, 0, 0.032);
    const double frequency = frequency_of(
        simulation, (sideways ? 0.3 : 1.0) * Vec3::Unit(axis), 3,
        [&] { return surface_displacement(simulation.tissue(), 2, top, axis, 0.008); });
    const char* name = sideways ? "frequency_sideways" : "frequency_upright";
    EXPECT_TRUE(is_within(sideways ? "its frequency sideways" : "its frequency upright",
                          error(frequency, "block", name), 0.015));
  }
}

// Anchors that move, and what they carry.
TEST_P(FiniteElementsOn, ReactionOfABarThatIsPulled) {
  for (const auto& [cell_size, held] : {std::pair{0.002, 0.0047}, {0.0023, 0.005}, {0.003, 0.0}}) {
    Scene scene = on_this(pulled_bar(cell_size, held));
    for (Anchor& anchor : scene.bodies[0].anchors) {
      if (cell_size == 0.002) continue;  // else it ends where the bar does, as one draws it
      for (const int axis : {1, 2}) anchor.min[axis] = -0.008, anchor.max[axis] = 0.008;
    }
    Simulation simulation(scene);
    const std::vector<Anchor>& anchors = simulation.scene().bodies[0].anchors;
    constexpr int kFrames = 30;
    for (int i = 1; i <= kFrames; ++i) {
      const Vec3 by(0.004 * i / kFrames, 0, 0);
      simulation.set_anchor(0, {anchors[0].origin() - by, Quat::Identity()});
      simulation.set_anchor(1, {anchors[1].origin() + by, Quat::Identity()});
      simulation.advance_frame();
    }
    EXPECT_TRUE(simulation.settle({1e-4, 2, 30}).at_rest);
    const std::vector<Wrench> loads = simulation.advance_frame().result.anchor_loads;
    for (const double pull : {loads[0].force.x(), -loads[1].force.x()}) {
      EXPECT_TRUE(is_within("reaction of a bar pulled by a fifth, 2 to 3 mm",
                            error(pull, "bar", "reaction_20_percent"), 0.01))
          << cell_size;
    }
  }
}

// A strip tears off an anchor under 12 g: what lies torn off in front of the face is not held by
// it, else it would be drawn into pieces by the hundred.
TEST_P(FiniteElementsOn, AnchorsLetGoOfWhatTearsOffInFrontOfThem) {
  Scene scene = on_this(reference_scene(0.002));
  scene.gravity = Vec3(120, 0, 0);
  scene.materials[0] = Material();
  scene.materials[0].name = "phantom";
  scene.materials[0].tear_stretch = 1.25;
  scene.bodies[0].size = Vec3(0.06, 0.012, 0.012);
  scene.bodies[0].pose.position = 0.5 * scene.bodies[0].size;
  scene.bodies[0].anchors = {beyond(0, 0.01, false)};
  Simulation simulation(scene);
  for (int frame = 0; frame < 15; ++frame) {
    ASSERT_FALSE(simulation.advance_frame().result.blew_up) << frame;
  }
  EXPECT_GT(simulation.tissue().fragment_count(), 1);
  EXPECT_LT(simulation.tissue().fragment_count(), 20);  // 788 before they let go
}

#if defined(TISSUE_SIM_CUDA)
// One law on both devices: at rest tissue bears what it does on a CPU. Read on an H200: the same
// six digits, with friction 4e-5 off, for what sticks depends on the way there.
TEST(FiniteElementScenes, ToolsAtRestPressOnAGpuAsOnACpu) {
  const std::string why = why_no_gpu();
  if (!why.empty()) GTEST_SKIP() << why;
  Tool plate = punch();
  plate.type = ToolType::kPlate;
  plate.size = Vec3(0.014, 0.01, 0.004);
  for (Tool tool : {ball(0.006), punch(), plate}) {
    for (const double friction : {0.0, 0.3}) {
      tool.friction = friction;
      double force[2];
      for (const Device device : {Device::kCpu, Device::kCuda}) {
        Scene scene = indented_cylinder(0.003, 0, tool);
        scene.device = device;
        scene.bodies[0].shape = Shape::kBox;
        scene.bodies[0].size = Vec3(0.036, 0.036, 0.024);
        Simulation simulation(scene);
        indentation_force(simulation, 0.002);
        const SettleReport report = simulation.settle({2e-6, 5, 30});
        EXPECT_TRUE(report.at_rest) << report.speed;
        force[device == Device::kCuda] = simulation.advance_frame().result.loads[0].mean.force.z();
      }
      std::printf("tool %d, friction %g: %.6f N on the GPU, %.6f on the CPU\n",
                  static_cast<int>(tool.type), friction, force[1], force[0]);
      EXPECT_GT(force[0], 0.01);
      EXPECT_NEAR(force[1] / force[0], 1, 1e-4);
    }
  }
}
#endif

}  // namespace
}  // namespace tissue_sim
