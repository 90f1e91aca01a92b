// Fluid and the tissue around it.
#include <gtest/gtest.h>

#include <cmath>

#include "fluid/fluid_scene.h"

namespace tissue_sim {
namespace {

/// Runs until the hollow is as full as was asked.
double fill_up(Simulation& simulation) {
  double before = -1, now = 0;
  for (int frame = 0; frame < 120 && now != before; ++frame) {
    before = now;
    if (simulation.advance_frame().result.blew_up) return 0;
    now = simulation.tissue().fluid_volumes()[0].total;
  }
  return now;
}

using FluidIn = FluidOn<MethodOnDevice>;
INSTANTIATE_TEST_SUITE_P(Methods, FluidIn, kEachMethodWithFluid, name_of_case);
using FluidInTissue = FluidOn<Device>;
INSTANTIATE_TEST_SUITE_P(Devices, FluidInTissue, kEachDevice, name_of_device);

/// A filled organ that falls: what the fluid gains of momentum the wall loses.
TEST_P(FluidIn, KeepsMomentum) {
  Scene scene = filled_ball(GetParam(), 200);
  Simulation simulation(scene);
  ASSERT_GT(fill_up(simulation), 0);
  simulation.set_gravity(Vec3(0.5, 0, -2));
  const Momentum before = simulation.tissue().momentum();
  constexpr int kFrames = 6;
  for (int i = 0; i < kFrames; ++i) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  const Momentum after = simulation.tissue().momentum();
  const Vec3 asked = before.mass * kFrames / scene.frame_rate * Vec3(0.5, 0, -2);
  EXPECT_LT((after.linear - before.linear - asked).norm() / asked.norm(), 1e-4);
}

/// A closed organ that is shaken: nothing passes its wall of two cells, and it holds the volume
/// that its fluid has under its pressure.
TEST_P(FluidInTissue, StaysInAClosedOrgan) {
  constexpr double kAsked = 5000;
  constexpr int kShakes = 6;
  Scene scene = filled_ball({Method::kPbd, GetParam()}, kAsked);
  scene.materials[0].young_modulus = 24 * kAsked;
  scene.bodies[0].anchors = {held_below(-0.015)};
  Simulation simulation(scene);
  const double volume = fill_up(simulation);
  ASSERT_GT(volume, 0);
  const auto fluid = [&] { return simulation.tissue().fluid_volumes()[0]; };
  const double modulus = 60 * kAsked;  // as a scene without gravity has it
  const auto packed = [&](const FluidVolume& of) {
    return of.total * (1 - of.pressure / modulus) /
           hollow_volume(simulation.tissue(), Vec3::Zero());
  };
  const double at_first = packed(fluid());
  for (int i = 0; i < kShakes; ++i) {
    simulation.set_gravity(Vec3(15 * std::sin(0.8 * i), 0, 15 * std::cos(0.5 * i)));
    ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  }
  simulation.set_gravity(Vec3::Zero());
  for (int i = 0; i < kShakes / 2; ++i) simulation.advance_frame();
  const FluidVolume after = fluid();
  EXPECT_DOUBLE_EQ(after.total, volume);
  EXPECT_DOUBLE_EQ(after.inside[0], volume);
  EXPECT_EQ(after.spilt, 0);
  EXPECT_NEAR(packed(after) / at_first, 1, 0.005);
  EXPECT_NEAR(after.pressure / kAsked, 1, 0.2);
}

BladePath slice(double x, double depth_from, double depth_to) {
  BladePath path;
  path.edge = {Vec3(0, -0.03, 0), Vec3(0, 0.03, 0)};
  path.poses = {{Vec3(x, 0, depth_from), Quat::Identity()},
                {Vec3(x, 0, depth_to), Quat::Identity()}};
  return path;
}

/// Area of the surface but for what a cut made, over that at rest: how far the wall is stretched.
double stretch(Tissue& tissue) {
  SurfaceTriangles surface;
  tissue.read_surface(surface);
  const auto area = [](const float* c) {
    const Vec3 x(c[0], c[1], c[2]);
    return (Vec3(c[3], c[4], c[5]) - x).cross(Vec3(c[6], c[7], c[8]) - x).norm();
  };
  double now = 0, at_rest = 0;
  for (std::size_t t = 0; t < surface.point.size(); ++t) {
    if (surface.cut[t] != 0) continue;
    now += area(&surface.corners[9 * t]);
    at_rest += area(&surface.rest[9 * t]);
  }
  return now / at_rest;
}

/// The figure that we reproduce: nothing leaves a whole organ; the further it is cut the more does,
/// and the severed wall contracts.
TEST_P(FluidInTissue, LeavesAnOrganThatIsCut) {
  Scene scene = filled_ball({Method::kMpm, GetParam()}, 500);
  scene.bodies[0].anchors = {held_below(-0.015)};
  Simulation whole(scene);
  ASSERT_GT(fill_up(whole), 0);
  const std::vector<std::uint8_t> full = whole.save();
  const double stretched = stretch(whole.tissue());
  double contracted = 0;
  const auto spilt_after = [&](double share) {
    Simulation simulation(scene);
    simulation.restore({full.data(), full.size()});
    if (share > 0) simulation.cut(slice(0.0004, 0.03, 0.018 - share * 0.036));
    for (int i = 0; i < 12; ++i) EXPECT_FALSE(simulation.advance_frame().result.blew_up);
    const FluidVolume fluid = simulation.tissue().fluid_volumes()[0];
    contracted = stretch(simulation.tissue());
    return fluid.spilt / fluid.total;
  };
  EXPECT_EQ(spilt_after(0), 0);
  const double some = spilt_after(0.3), more = spilt_after(0.6), all = spilt_after(1);
  EXPECT_GT(some, 0.001);
  EXPECT_GT(more, some);
  EXPECT_GT(all, more);
  EXPECT_GT(stretched, 1.01);
  EXPECT_NEAR(contracted, 1, 0.003);
  RecordProperty("spilt",
                 std::to_string(some) + " " + std::to_string(more) + " " + std::to_string(all));
  RecordProperty("stretch", std::to_string(stretched) + " " + std::to_string(contracted));
}

/// A filled organ that cuts part wholly, into pieces, shreds and bits of a fraction of a point: its
/// fluid comes out, nothing is thrown, and momentum is what it was.
TEST_P(FluidInTissue, LeavesAnOrganThatComesApart) {
  Simulation simulation(filled_ball({Method::kMpm, GetParam()}, 500));
  ASSERT_GT(fill_up(simulation), 0);
  const Momentum before = simulation.tissue().momentum();
  for (int i = 0; i < 4; ++i) {
    const Quat turn(Eigen::AngleAxisd(0.1 + 0.4 * i, Vec3(0.3, 1, 0.1).normalized()));
    BladePath path;
    path.edge = {Vec3(0, -0.04, 0), Vec3(0, 0.04, 0)};
    for (const double z : {0.03, -0.03}) {
      path.poses.push_back({turn * Vec3(0.0011 * i - 0.003, 0, z), turn});
    }
    simulation.cut(path);
  }
  double fastest = 0;
  for (int i = 0; i < 8; ++i) {
    const FrameResult result = simulation.advance_frame().result;
    ASSERT_FALSE(result.blew_up);
    fastest = std::max<double>(fastest, result.max_speed);
  }
  EXPECT_GT(simulation.tissue().fragment_count(), 8);
  EXPECT_LT(fastest, 2);
  const FluidVolume fluid = simulation.tissue().fluid_volumes()[0];
  EXPECT_GT(fluid.spilt / fluid.total, 0.5);
  const Momentum after = simulation.tissue().momentum();
  EXPECT_LT((after.linear - before.linear).norm() / (after.mass * fastest), 1e-4);
  RecordProperty("fastest", std::to_string(fastest));
}

/// A filled ball grows as Lamé has it for a thick wall, by the pressure that its fluid has.
TEST_P(FluidInTissue, SwellsAWallAsLameHasIt) {
  Scene scene = filled_ball({Method::kMpm, GetParam()}, 200);
  scene.cell_size = 0.002;  // three cells of wall
  scene.damping = 5;
  Simulation simulation(scene);
  const double inner = 0.012, outer = 0.018;
  const double before = hollow_volume(simulation.tissue(), Vec3::Zero());
  EXPECT_NEAR(before / (4 * M_PI / 3 * std::pow(inner, 3)), 1, 0.05);
  constexpr int kSettle = 25, kFrames = 5;
  double strain = 0, pressure = 0;
  for (int i = 0; i < kSettle + kFrames; ++i) {
    ASSERT_FALSE(simulation.advance_frame().result.blew_up);
    if (i < kSettle) continue;
    const double volume = hollow_volume(simulation.tissue(), Vec3::Zero());
    strain += (std::cbrt(volume / before) - 1) / kFrames;
    pressure += simulation.tissue().fluid_volumes()[0].pressure / kFrames;
  }
  const double young = 20e3, poisson = 0.4, ratio = std::pow(outer / inner, 3);
  const double asked =
      pressure / young / (ratio - 1) * (1 - 2 * poisson + (1 + poisson) * ratio / 2);
  RecordProperty("of_lame", std::to_string(strain / asked));
  EXPECT_NEAR(pressure / 200, 1, 0.1);
  EXPECT_NEAR(strain / asked, 1, 0.05);
}

/// Water leaves through a slit of ten spacings in a wall of 1 MPa as fast as Torricelli has it, in
/// a jet of 0.6 to 0.65 of the slit.
TEST_P(FluidInTissue, LeavesThroughASlitAsTorricelliHasIt) {
  constexpr double kSpacing = 0.003, kSlit = 10 * kSpacing, kDepth = 4 * kSpacing;
  constexpr double kBelow = 0.045, kAbove = 0.09, kWidth = 0.075, kTop = kBelow + kSlit + kAbove;
  Scene scene;
  scene.device = GetParam();
  scene.threads = 1;
  scene.cell_size = kSpacing;
  scene.ground.enabled = false;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.frame_rate = 240;
  Material wall;
  wall.name = "wall";
  wall.young_modulus = 1e6;
  wall.poisson_ratio = 0.4;
  scene.materials = {wall};
  for (const bool over : {false, true}) {
    Body body;
    body.name = over ? "over" : "under";
    body.material = "wall";
    const double length = over ? kAbove + 0.015 : kBelow + 2 * kSpacing;
    const double middle = over ? kBelow + kSlit + length / 2 : kBelow - length / 2;
    body.size = Vec3(2 * kSpacing, kDepth, length);
    body.pose.position = Vec3(kWidth + kSpacing, kDepth / 2, middle);
    Region held;  // all but its lip
    held.kind = Region::Kind::kBox;
    held.min = Vec3(-1, -1, over ? kBelow + kSlit + 1.2 * kSpacing : -1);
    held.max = Vec3(1, 1, over ? 1 : kBelow - 1.2 * kSpacing);
    body.anchors = {held};
    scene.bodies.push_back(body);
  }
  Pool pool;
  pool.region.kind = Region::Kind::kBox;
  pool.region.min = Vec3::Zero();
  pool.region.max = Vec3(kWidth, kDepth, kTop);
  scene.pools = {pool};
  auto tanks = tank({0, 0, 0}, {kWidth, kDepth, kTop});
  for (TankWall& w : tanks) w.size = Vec3(1, 1, 0.02);
  tanks[0].place.x() = kWidth - 0.5;
  tanks.erase(tanks.begin() + 2);  // there the tissue is
  add_tools(tanks, scene);
  Simulation simulation(scene);
  FrameRequest request = stand(tanks);
  const double each =
      simulation.tissue().fluid_volumes()[0].total / simulation.tissue().fluid_particle_count();
  const auto there = [&] {
    double volume = 0;
    for (const FluidPoint& p : fluid_of(simulation)) volume += p.x < kWidth ? each : 0;
    return volume;
  };
  constexpr int kBegin = 30, kEnd = 48;  // the jet stands
  double before = 0;
  for (int i = 0; i < kEnd; ++i) {
    ASSERT_FALSE(simulation.advance_frame(request).result.blew_up);
    request = {};
    if (i + 1 == kBegin) before = there();
  }
  const double after = there(), flow = (before - after) * scene.frame_rate / (kEnd - kBegin);
  const double level = (before + after) / 2 / (kWidth * kDepth);
  const double low = level - kBelow - kSlit, high = level - kBelow;
  const double free =
      kDepth * std::sqrt(2 * 9.81) * 2 / 3 * (std::pow(high, 1.5) - std::pow(low, 1.5));
  RecordProperty("contraction", std::to_string(flow / free));
  EXPECT_NEAR(flow / free, 0.625, 0.06);
}

/// One and two threads, and a state that was saved on the way: the same bits.
TEST_P(FluidInTissue, HasTheSameBits) {
  Scene scene = filled_ball({Method::kMpm, GetParam()}, 300);
  const auto run = [&](int threads, int restore_at) {
    scene.threads = threads;
    auto simulation = std::make_unique<Simulation>(scene);
    std::vector<std::uint64_t> sums;
    for (int i = 0; i < 8; ++i) {
      if (i == restore_at) {
        const std::vector<std::uint8_t> state = simulation->save();
        simulation = std::make_unique<Simulation>(scene);
        simulation->restore({state.data(), state.size()});
      }
      if (i == 3) simulation->cut(slice(0.0004, 0.03, 0));
      simulation->advance_frame();
      sums.push_back(simulation->tissue().checksum());
    }
    return sums;
  };
  const auto once = run(1, -1);
  EXPECT_EQ(run(2, -1), once);
  EXPECT_EQ(run(1, 2), once);
  EXPECT_EQ(run(2, 5), once);
}

}  // namespace
}  // namespace tissue_sim
