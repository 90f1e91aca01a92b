// Instruments and the ground against tissue: pushes, friction, wrenches, cuts by motion.
#include <gtest/gtest.h>

#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

/// A pose whose tip points down, cutting towards +x.
Pose pointing_down(const Vec3& tip) {
  Eigen::Matrix3d r;
  r.col(0) = Vec3::UnitX();
  r.col(1) = -Vec3::UnitY();
  r.col(2) = -Vec3::UnitZ();
  return {tip, Quat(r)};
}

Tool scalpel() {
  Tool t;
  t.name = "scalpel";
  t.type = ToolType::kScalpel;
  t.blade_length = 0.05;
  return t;
}

TEST(Probe, FeelsTheOppositeOfWhatItGives) {
  Scene scene = free_box(Vec3(0.03, 0.03, 0.02), 0.003);
  Tool probe;
  probe.radius = 0.006;
  scene.tools.push_back(probe);
  MpmTissue tissue(scene);
  ToolMotion motion;
  motion.present = true;
  motion.begin = motion.end = pointing_down(Vec3(0.015, 0.012, 0.03));
  Vec3 impulse = Vec3::Zero();
  double peak = 0, longest = 0;
  const double frame = 1.0 / 60;
  for (int f = 0; f < 30; ++f) {
    motion.begin = motion.end;
    motion.end.position += Vec3(1e-4, 0, -7e-4);
    const int n = static_cast<int>(std::ceil(frame / tissue.stable_substep()));
    advance_by(tissue, n, static_cast<float>(frame / n), {{&motion, 1}, {}});
    const FrameResult r = tissue.finish();
    impulse += r.loads[0].mean.force * frame;
    peak = std::max(peak, r.loads[0].peak_force);
    longest = std::max(longest, r.loads[0].mean.force.norm());
  }
  const Vec3 p = tissue.momentum().linear;
  EXPECT_LT(p[2], -1e-5) << "pushed down";
  EXPECT_LT((impulse + p).norm(), 1e-3 * p.norm());
  EXPECT_GE(peak, longest);
}

TEST(FrameColliders, PowerIsForceTimesVelocityAndMomentTimesSpin) {
  Scene scene = free_box(Vec3(0.03, 0.03, 0.02), 0.003);
  scene.tools.emplace_back();
  ToolMotion motion;
  motion.present = true;
  motion.begin = pointing_down(Vec3(0.015, 0.012, 0.03));
  motion.end = {motion.begin.position + Vec3(0.01, 0, 0),
                Quat(Eigen::AngleAxisd(0.2, Vec3::UnitZ())) * motion.begin.orientation};
  const FrameColliders colliders(scene, {{&motion, 1}, {}}, 0.1);
  std::vector<ColliderLoad> on(colliders.count());
  on[0].force[2] = -5;  // the ground is still
  on[1].force[0] = -2;
  on[1].torque[2] = -3;
  std::vector<Collider> now;
  colliders.at(0.5, now);
  EXPECT_NEAR(colliders.power(now.data(), on.data()), 2 * 0.1 + 3 * 2, 1e-4);
}

TEST(Probe, LeavesTissueAloneThatItDoesNotTouch) {
  Scene scene = free_box(Vec3(0.03, 0.03, 0.02), 0.003);
  scene.tools.emplace_back();
  Simulation simulation(scene);
  simulation.set_tool(0, pointing_down(Vec3(0.015, 0.015, 0.0205)));
  const FrameReport report = simulation.advance_frame();
  EXPECT_EQ(report.result.loads[0].peak_force, 0);
  EXPECT_EQ(report.result.kinetic_energy, 0);
}

TEST(Probe, IsNotThereBeforeItsFirstPose) {
  Scene scene = free_box(Vec3(0.03, 0.03, 0.02), 0.003);
  scene.tools.emplace_back();
  Simulation simulation(scene);  // the tool's frame would be the origin, in the body's corner
  EXPECT_EQ(simulation.advance_frame().result.loads[0].peak_force, 0);
}

TEST(Probe, PressedInSinksNoDeeperThanContactIsStiff) {
  Scene scene = free_box(Vec3(0.06, 0.06, 0.03), 0.003);
  scene.damping = 20;
  Region floor;
  floor.z = 0.003;
  scene.bodies[0].anchors.push_back(floor);
  Tool probe;
  probe.radius = 0.01;
  scene.tools.push_back(probe);
  Simulation simulation(scene);
  const double depth = 0.004;
  for (int f = 0; f < 90; ++f) {
    const double s = std::min(1.0, f / 30.0);
    simulation.set_tool(0, pointing_down(Vec3(0.03, 0.03, 0.03 - s * depth)));
    simulation.advance_frame();
  }
  const FrameReport report = simulation.advance_frame();
  const Vec3 force = report.result.loads[0].mean.force;
  EXPECT_GT(force[2], 0);
  EXPECT_LT(std::hypot(force[0], force[1]), 0.02 * force[2]);
  // Hertz: F = 4/3 E / (1 - nu^2) sqrt(R d^3), for a half space; the block is 3 R thick.
  const double hertz = 4.0 / 3 * 5000 / (1 - 0.45 * 0.45) * std::sqrt(0.01 * std::pow(depth, 3));
  EXPECT_GT(force[2], 0.7 * hertz);
  EXPECT_LT(force[2], 1.5 * hertz);
  std::vector<std::uint8_t> cloud;
  simulation.tissue().read_points({}, cloud);
  double deepest = 0;
  const Vec3 center(0.03, 0.03, 0.03 - depth + 0.01);
  for (std::size_t i = 0; i < cloud.size(); i += sizeof(Point)) {
    const auto* p = reinterpret_cast<const Point*>(&cloud[i]);
    deepest = std::max(deepest, 0.01 - (Vec3(p->x, p->y, p->z) - center).norm());
  }
  EXPECT_LT(deepest, 0.25 * 0.003) << "points inside the probe";
}

/// How far a block slides on the ground in a second under gravity tilted by `slope` (tangent).
double slide(double slope, double friction) {
  Scene scene = free_box(Vec3(0.03, 0.03, 0.012), 0.003);
  scene.ground.enabled = true;
  scene.ground.friction = friction;
  scene.damping = 5;  // or it would hop on and on
  Material damped;    // and its sole would sing, which takes friction along its own motion
  damped.name = "damped";
  damped.viscosity = 3;
  scene.materials.push_back(damped);
  scene.bodies[0].material = "damped";
  scene.gravity = Vec3(9.81 * slope, 0, -9.81);
  Simulation simulation(scene);
  const auto x = [&] {
    simulation.advance_frame();
    return simulation.tissue().fragments()[0].centroid[0];
  };
  for (int f = 0; f < 150; ++f) simulation.advance_frame();
  const double begin = x();
  for (int f = 0; f < 59; ++f) simulation.advance_frame();
  return x() - begin;
}

TEST(Ground, HoldsBelowTheFrictionAngleAndLetsSlideAbove) {
  EXPECT_LT(std::fabs(slide(0.25, 0.3)), 1e-4);
  // Above it, speed grows to 9.81 (0.35 - 0.3) / 5 m/s.
  EXPECT_NEAR(slide(0.35, 0.3), 9.81 * 0.05 / 5, 0.02);
}

TEST(Scalpel, CutsWhereItIsDrawnAndOnlyThere) {
  Scene scene = free_box(Vec3(0.04, 0.03, 0.02), 0.002);
  Region floor;  // or the blade would push the body along
  floor.z = 0.002;
  scene.bodies[0].anchors.push_back(floor);
  scene.tools.push_back(scalpel());
  Simulation simulation(scene);
  std::vector<int> fresh;
  std::int64_t bonds = 0;
  for (int f = 0; f <= 60; ++f) {  // along +x, a little slanted
    const double x = -0.005 + 0.055 * f / 60;
    simulation.set_tool(0, pointing_down(Vec3(x, 0.012 + 0.1 * x, -0.003)));
    const FrameReport report = simulation.advance_frame();
    bonds += report.result.blade_report.bonds_broken;
    for (const int id : report.result.blade_report.new_fragments) fresh.push_back(id);
  }
  EXPECT_EQ(fresh, std::vector<int>{1});
  EXPECT_GE(bonds, 40 * 20);
  double total = 0;
  for (const Fragment& f : simulation.tissue().fragments()) {
    total += f.volume;
    EXPECT_NEAR(f.volume, f.id == 0 ? 0.04 * 0.016 * 0.02 : 0.04 * 0.014 * 0.02, 5e-7);
  }
  EXPECT_NEAR(total, 24e-6, 1e-9);
}

TEST(Scalpel, StabbedInCutsASlot) {
  Scene scene = free_box(Vec3(0.04, 0.03, 0.02), 0.002);
  scene.tools.push_back(scalpel());
  Simulation simulation(scene);
  std::int64_t bonds = 0;
  for (int f = 0; f <= 20; ++f) {
    simulation.set_tool(0, pointing_down(Vec3(0.0203, 0.0152, 0.022 - 0.012 * f / 20)));
    bonds += simulation.advance_frame().result.blade_report.bonds_broken;
  }
  // Six millimetres wide and ten deep at a millimetre a bond.
  EXPECT_NEAR(bonds, 60, 15);
  EXPECT_EQ(simulation.tissue().fragments().size(), 1u);
}

TEST(Scalpel, AtRestCutsTissueThatFallsOntoIt) {
  Scene scene = free_box(Vec3(0.02, 0.02, 0.02), 0.002);
  Tool blade = scalpel();
  scene.tools.push_back(blade);
  scene.gravity = Vec3(0, -9.81, 0);
  Simulation simulation(scene);
  Eigen::Matrix3d r;  // its edge looks up, along +y
  r.col(0) = Vec3::UnitY();
  r.col(1) = Vec3::UnitX();
  r.col(2) = -Vec3::UnitZ();
  simulation.set_tool(0, {Vec3(0.0101, -0.001, -0.01), Quat(r)});
  std::int64_t bonds = 0;
  for (int f = 0; f < 6; ++f) bonds += simulation.advance_frame().result.blade_report.bonds_broken;
  EXPECT_EQ(bonds, 20 * 20);
  EXPECT_EQ(simulation.tissue().fragments().size(), 2u);
}

}  // namespace
}  // namespace tissue_sim
