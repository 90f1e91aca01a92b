// Tubes, wounds, fill and drain.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "fluid/fluid_scene.h"

namespace tissue_sim {
namespace {

FluidVolume volumes(Simulation& simulation) { return simulation.tissue().fluid_volumes()[0]; }

/// A pool on the ground, and a tube whose mouth is above it, looking down.
Scene pool_and_tube(ToolType type, double flow, Device device = Device::kCpu) {
  Scene scene;
  scene.device = device;
  scene.cell_size = 0.004;
  scene.bodies = {far_body(scene.cell_size)};
  Pool pool;
  pool.fluid = "saline";
  pool.region.kind = Region::Kind::kBox;
  pool.region.max = Vec3(0.024, 0.024, 0.012);
  scene.pools = {pool};
  Tool tube;
  tube.name = "tube";
  tube.type = type;
  tube.radius = 0.004;
  tube.flow = flow;
  scene.tools = {tube};
  return scene;
}

FrameRequest tube_at(double x, double y, double z, FrameRequest request = {}) {
  ToolRequest tool;
  tool.pose = {Vec3(x, y, z), Quat(0, 1, 0, 0)};
  request.tools.insert(request.tools.begin(), tool);
  return request;
}

using FluidFromTubes = FluidOn<Device>;
INSTANTIATE_TEST_SUITE_P(Devices, FluidFromTubes, kEachDevice, name_of_device);

TEST_P(FluidFromTubes, SuctionTakesItsFlowAndNoMoreThanIsThere) {
  constexpr double kFlow = 2e-6, kParticle = 64e-9;
  Scene scene = pool_and_tube(ToolType::kSuction, kFlow, GetParam());
  const auto walls = tank({0, 0, 0}, {0.024, 0.024, 0.05});
  add_tools(walls, scene);
  Simulation away(scene), simulation(scene);
  const double poured = volumes(simulation).total;
  away.advance_frame(tube_at(0.012, 0.012, 0.1, stand(walls)));
  away.advance_frame();
  EXPECT_EQ(volumes(away).sucked, 0);
  FrameRequest request = tube_at(0.012, 0.012, 0.006, stand(walls));
  constexpr int kFrames = 12;
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_FALSE(simulation.advance_frame(request).result.blew_up);
    request = {};
  }
  const FluidVolume now = volumes(simulation);
  EXPECT_NEAR(now.sucked, kFlow * kFrames / scene.frame_rate, 2 * kParticle);
  EXPECT_NEAR((now.sucked + now.total) / poured, 1, 1e-6);
}

TEST_P(FluidFromTubes, IrrigationGivesItsFlow) {
  constexpr double kFlow = 1e-5, kParticle = 64e-9;
  Scene scene = pool_and_tube(ToolType::kIrrigation, kFlow, GetParam());
  scene.pools.clear();
  Simulation simulation(scene);
  EXPECT_EQ(simulation.tissue().fluid_particle_count(), 0);
  FrameRequest request = tube_at(0, 0, 0.03);
  constexpr int kFrames = 10;
  for (int i = 0; i < kFrames; ++i) {
    ASSERT_FALSE(simulation.advance_frame(request).result.blew_up);
    request = {};
  }
  const FluidVolume now = volumes(simulation);
  EXPECT_NEAR(now.irrigated, kFlow * kFrames / scene.frame_rate, 2 * kParticle);
  EXPECT_NEAR(now.total / now.irrigated, 1, 1e-6);
  double fastest = 0;
  for (const FluidPoint& p : fluid_of(simulation)) {
    EXPECT_GE(p.z, 0);
    EXPECT_LT(p.z, 0.03);
    fastest = std::max<double>(fastest, -p.vz);
  }
  EXPECT_GT(fastest, 0.9 * kFlow / (M_PI * 0.004 * 0.004));
}

/// A beam that is held at one end; what a blade opens bleeds.
Scene beam(const MethodOnDevice& on) {
  Scene scene;
  scene.method = on.method;
  scene.device = on.device;
  scene.threads = 1;
  scene.cell_size = 0.004;
  scene.pbd.model = PbdModel::kTetrahedra;
  Material liver;
  liver.bleeding.flux = 0.004;
  liver.bleeding.pressure = 2000;
  liver.bleeding.clots_after = 0.4;
  scene.materials = {liver};
  Body body;
  body.size = Vec3(0.048, 0.02, 0.02);
  body.pose.position.z() = 0.0305;
  Anchor held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-0.025, -0.02, 0);
  held.max = Vec3(0.0, 0.02, 0.06);
  body.anchors = {held};
  scene.bodies = {body};
  return scene;
}

BladePath across(double x) {
  BladePath path;
  path.edge = {Vec3(0, -0.03, 0), Vec3(0, 0.03, 0)};
  path.poses = {{Vec3(x, 0, 0.06), Quat::Identity()}, {Vec3(x, 0, 0.01), Quat::Identity()}};
  return path;
}

using FluidFromWounds = FluidOn<MethodOnDevice>;
INSTANTIATE_TEST_SUITE_P(Methods, FluidFromWounds, kEachMethodWithFluid, name_of_case);

TEST_P(FluidFromWounds, BleedsWhatWasOpenedUntilItClots) {
  Scene scene = beam(GetParam());
  Simulation simulation(scene);
  for (int i = 0; i < 3; ++i) simulation.advance_frame();
  EXPECT_EQ(volumes(simulation).bled, 0);
  simulation.cut(across(0.0113));
  double most = 0;
  for (int i = 0; i < 20; ++i) {
    ASSERT_FALSE(simulation.advance_frame().result.blew_up);
    most = std::max(most, volumes(simulation).bleeding);
  }
  const double after = volumes(simulation).bled;
  EXPECT_GT(after, 0);
  EXPECT_GT(most, 0);
  EXPECT_NEAR(volumes(simulation).total, after, 1e-6 * after);
  // No more than flux, area of both sides and time allow, as it clots evenly.
  constexpr double kArea = 2 * 0.02 * 0.02;
  EXPECT_LT(after, 1.3 * 0.004 * kArea * 0.5 * 0.4);
  EXPECT_GT(after, 0.4 * 0.004 * kArea * 0.5 * 0.4);
  for (int i = 0; i < 10; ++i) simulation.advance_frame();
  const double clotted = volumes(simulation).bled;
  for (int i = 0; i < 6; ++i) simulation.advance_frame();
  EXPECT_EQ(volumes(simulation).bled, clotted);
  EXPECT_EQ(volumes(simulation).bleeding, 0);
}

TEST_P(FluidFromTubes, FillsAndDrainsAnOrgan) {
  Simulation simulation(filled_ball({Method::kPbd, GetParam()}, 300));
  for (int i = 0; i < 10; ++i) simulation.advance_frame();
  const double before = volumes(simulation).total;
  simulation.fill(0, 900);
  for (int i = 0; i < 20; ++i) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  const FluidVolume full = volumes(simulation);
  EXPECT_GT(full.total, 1.005 * before);
  EXPECT_GT(full.pressure, 450);
  const double taken = 0.1 * full.total;
  simulation.drain(0, taken);
  for (int i = 0; i < 35; ++i) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  const FluidVolume drained = volumes(simulation);
  constexpr double kParticle = 27e-9;  // and half of one that filling made larger
  EXPECT_NEAR(drained.drained, taken, 1.5 * kParticle);
  EXPECT_NEAR((drained.total + drained.drained) / full.total, 1, 1e-6);
  EXPECT_LT(drained.pressure, 0.7 * full.pressure);
}

/// What was recorded runs again, and a saved state goes on, with the same bits: with wounds, a
/// tube, and orders.
TEST_P(FluidFromTubes, RunsAgainWithTheSameBits) {
  Scene scene = beam({Method::kPbd, GetParam()});
  Tool tube;
  tube.name = "tube";
  tube.type = ToolType::kSuction;
  tube.flow = 2e-6;
  scene.tools = {tube};
  scene.bodies.push_back(filled_ball({Method::kPbd, GetParam()}, 300).bodies[0]);
  scene.bodies[1].name = "ball";
  scene.bodies[1].material = "liver";
  scene.bodies[1].wall = 0.008;
  scene.bodies[1].radius = 0.022;
  scene.bodies[1].pose.position = Vec3(0.2, 0, 0.04);
  scene.threads = 1;
  Simulation simulation(scene);
  std::vector<AppliedInput> inputs;
  std::vector<std::uint64_t> sums;
  std::vector<std::uint8_t> state;
  constexpr int kFrames = 10, kSaved = 5;
  for (int i = 0; i < kFrames; ++i) {
    if (i == kSaved) state = simulation.save();
    FrameRequest request = tube_at(0.014, 0, 0.035 - 0.001 * i);
    if (i == 1) request.cuts = {across(0.0113)};
    if (i == 3) simulation.fill(1, 800);
    if (i == kSaved - 1) simulation.drain(1, 2e-6);
    inputs.push_back(simulation.advance_frame(request).input);
    sums.push_back(simulation.tissue().checksum());
  }
  EXPECT_GT(volumes(simulation).drained + simulation.tissue().fluid_volumes()[1].drained, 0);
  scene.threads = 2;
  Simulation again(scene), on(scene);
  on.restore({state.data(), state.size()});
  for (int i = 0; i < kFrames; ++i) {
    again.repeat_frame(inputs[i]);
    EXPECT_EQ(again.tissue().checksum(), sums[i]) << i;
    if (i < kSaved) continue;
    on.repeat_frame(inputs[i]);
    EXPECT_EQ(on.tissue().checksum(), sums[i]) << i;
  }
  const FluidVolume a = volumes(simulation), b = volumes(on);
  EXPECT_EQ(a.bled, b.bled);
  EXPECT_EQ(a.sucked, b.sucked);
}

template <class F>
std::string refusal(const F& f) {
  try {
    f();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "none";
}

TEST(FluidSources, AreRefusedInOneLine) {
  Scene scene = beam({Method::kMpm, Device::kCpu});
  scene.materials[0].bleeding.flux = 2;
  EXPECT_NE(refusal([&] { validate(scene); }).find("materials[0].bleeding.flux is 2"),
            std::string::npos);
  scene.materials[0].bleeding.flux = 0.1;
  scene.materials[0].bleeding.fluid = "gin";
  EXPECT_NE(refusal([&] { validate(scene); }).find("materials[0].bleeding.fluid is \"gin\""),
            std::string::npos);
  scene = pool_and_tube(ToolType::kIrrigation, 1);
  EXPECT_NE(refusal([&] { validate(scene); }).find("tools[0].flow is 1"), std::string::npos);
  scene.tools[0].flow = 1e-6;
  scene.tools[0].fluid = "gin";
  EXPECT_NE(refusal([&] { validate(scene); }).find("tools[0].fluid is \"gin\""), std::string::npos);
  Simulation simulation(pool_and_tube(ToolType::kSuction, 1e-6));
  EXPECT_EQ(refusal([&] { simulation.fill(0, 100); }),
            "body 'far' is none of the scene's that are filled");
  EXPECT_EQ(refusal([&] { simulation.drain(7, 1e-6); }),
            "body 7 is none of the scene's that are filled");
  Simulation filled(filled_ball({Method::kPbd, Device::kCpu}, 100));
  EXPECT_NE(refusal([&] { filled.fill(0, 2e5); }).find("pressure is 200000"), std::string::npos);
  EXPECT_NE(refusal([&] { filled.drain(0, -1); }).find("volume is -1"), std::string::npos);
}

TEST(FluidSources, ComeBackFromYaml) {
  Scene scene = beam({Method::kMpm, Device::kCpu});
  scene.tools = pool_and_tube(ToolType::kIrrigation, 3e-6).tools;
  scene.tools.push_back(pool_and_tube(ToolType::kSuction, 2e-6).tools[0]);
  scene.tools[1].name = "suction";
  scene.tools[0].fluid = "water";
  const std::string yaml = scene_to_yaml(scene);
  EXPECT_EQ(scene_to_yaml(scene_from_yaml(yaml)), yaml);
  const Scene back = scene_from_yaml(yaml);
  EXPECT_EQ(back.materials[0].bleeding.clots_after, 0.4);
  EXPECT_EQ(back.tools[0].fluid, "water");
  EXPECT_EQ(back.tools[1].flow, 2e-6);
  EXPECT_EQ(back.tools[1].type, ToolType::kSuction);
}

}  // namespace
}  // namespace tissue_sim
