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

class FluidIn : public testing::TestWithParam<Method> {};

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
TEST(FluidInTissue, StaysInAClosedOrgan) {
  constexpr double kAsked = 5000;
  constexpr int kShakes = 6;
  Scene scene = filled_ball(Method::kPbd, kAsked);
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

std::string method_name(const testing::TestParamInfo<Method>& info) {
  return info.param == Method::kMpm ? "Mpm" : "Pbd";
}

INSTANTIATE_TEST_SUITE_P(Methods, FluidIn, testing::Values(Method::kMpm, Method::kPbd),
                         method_name);

BladePath slice(double x, double depth_from, double depth_to) {
  BladePath path;
  path.edge = {Vec3(0, -0.03, 0), Vec3(0, 0.03, 0)};
  path.poses = {{Vec3(x, 0, depth_from), Quat::Identity()},
                {Vec3(x, 0, depth_to), Quat::Identity()}};
  return path;
}

/// The figure that we reproduce: nothing leaves a whole organ; the further it is cut the more does.
TEST(FluidInTissue, LeavesAnOrganThatIsCut) {
  Scene scene = filled_ball(Method::kMpm, 500);
  scene.bodies[0].anchors = {held_below(-0.015)};
  Simulation whole(scene);
  ASSERT_GT(fill_up(whole), 0);
  const std::vector<std::uint8_t> full = whole.save();
  const auto spilt_after = [&](double share) {
    Simulation simulation(scene);
    simulation.restore({full.data(), full.size()});
    if (share > 0) simulation.cut(slice(0.0004, 0.03, 0.018 - share * 0.036));
    for (int i = 0; i < 12; ++i) EXPECT_FALSE(simulation.advance_frame().result.blew_up);
    const FluidVolume fluid = simulation.tissue().fluid_volumes()[0];
    return fluid.spilt / fluid.total;
  };
  EXPECT_EQ(spilt_after(0), 0);
  const double some = spilt_after(0.3), more = spilt_after(0.6), all = spilt_after(1);
  EXPECT_GT(some, 0.001);
  EXPECT_GT(more, some);
  EXPECT_GT(all, more);
  RecordProperty("spilt",
                 std::to_string(some) + " " + std::to_string(more) + " " + std::to_string(all));
}

/// One and two threads, and a state that was saved on the way: the same bits.
TEST(FluidInTissue, HasTheSameBits) {
  Scene scene = filled_ball(Method::kMpm, 300);
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
