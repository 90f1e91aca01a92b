// Graspers: where their jaws are, what they hold and what they feel. On the CPU and, where there is
// one, on the GPU.
#include <gtest/gtest.h>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"
#include "tools/grip.h"

namespace tissue_sim {
namespace {

Tool grasper() {
  Tool t;
  t.name = "grasper";
  t.type = ToolType::kGrasper;
  t.friction = 1;
  return t;
}

/// Tip down, the jaws open along x.
Pose pointing_down(const Vec3& tip) { return {tip, Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()))}; }

/// A block of 8 x 12 x 20 mm on the ground, above the origin, and a grasper.
Scene block_on_ground(double young_modulus) {
  Scene scene = free_box(Vec3(0.008, 0.012, 0.02), 0.002);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.01);
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  Material m;
  m.name = "test";
  m.young_modulus = young_modulus;
  m.viscosity = 5;
  scene.materials = {m};
  scene.bodies[0].material = "test";
  scene.tools = {grasper()};
  return scene;
}

template <class T>
class GrasperOf : public OnEitherDevice<T> {
 protected:
  static Scene on_device(Scene scene) {
    scene.device = std::is_same<T, MpmTissue>::value ? Device::kCpu : Device::kCuda;
    return scene;
  }
};
TYPED_TEST_SUITE(GrasperOf, Tissues, DeviceName);

/// Moves the tip from `from` to `to` and the jaws from `open` to `closed` in so many seconds.
FrameReport move(Simulation& simulation, const Vec3& from, const Vec3& to, double open,
                 double closed, double seconds) {
  FrameReport report;
  const int frames = static_cast<int>(std::lround(60 * seconds));
  for (int f = 1; f <= frames; ++f) {
    const double s = static_cast<double>(f) / frames;
    simulation.set_tool(0, pointing_down(from + s * (to - from)), open + s * (closed - open));
    report = simulation.advance_frame();
    EXPECT_FALSE(report.result.blew_up) << "in frame " << report.input.frame;
    if (report.result.blew_up) break;
  }
  return report;
}

double height(Simulation& simulation) { return simulation.tissue().fragments()[0].centroid[2]; }

TYPED_TEST(GrasperOf, LiftsABlockFeelsItsWeightAndLetsItGo) {
  for (const double young_modulus : {5e3, 1e5}) {
    Scene scene = block_on_ground(young_modulus);
    scene.tools[0].grip_pressure = 0.4 * young_modulus;
    Simulation simulation(this->on_device(scene));
    const Vec3 low(0, 0, 0.012), high(0, 0, 0.034);
    move(simulation, low, low, 1.8, 1.8, 0.1);
    const double before = height(simulation);
    move(simulation, low, low, 1.8, 0, 0.7);
    move(simulation, low, high, 0, 0, 0.5);
    FrameReport report = move(simulation, high, high, 0, 0, 0.4);
    EXPECT_NEAR(height(simulation) - before, high[2] - low[2], 0.002) << young_modulus;
    const double held = height(simulation);
    report = move(simulation, high, high, 0, 0, 0.5);
    EXPECT_TRUE(is_within("a block that jaws lift: slip", 1e3 * (height(simulation) - held),
                          1e3 * 2e-4, "mm"))
        << young_modulus;
    const double weight = 9.81 * 1060 * 0.008 * 0.012 * 0.02;
    const Vec3 force = report.result.loads[0].mean.force;
    EXPECT_TRUE(
        is_at_most("its weight, off", (force + Vec3(0, 0, weight)).norm() / weight, 0.03, "%"))
        << young_modulus;
    move(simulation, high, high, 0, 1.8, 0.7);
    move(simulation, high, high + Vec3(0, 0, 0.03), 1.8, 1.8, 0.4);
    EXPECT_LT(height(simulation), before + 0.003) << "still held, " << young_modulus;
  }
}

TYPED_TEST(GrasperOf, PressesWithItsPressureAndNoMore) {
  for (const double young_modulus : {5e3, 2e4, 1e5, 1e6}) {
    Scene scene = block_on_ground(young_modulus);
    const double pressure = scene.tools[0].grip_pressure = 0.4 * young_modulus;
    Simulation simulation(this->on_device(scene));
    const Vec3 low(0, 0, 0.012);
    move(simulation, low, low, 1.8, 1.8, 0.1);
    double most = 0;
    FrameReport report;
    const auto pressed = [&] {
      const ToolLoad& load = report.result.loads[0];
      return load.grip_area > 0 ? load.grip / load.grip_area : 0;
    };
    for (int f = 0; f < 60; ++f) {
      report = move(simulation, low, low, 0, 0, 1.0 / 60);
      most = std::max(most, pressed());
    }
    const float closed = report.input.tools[0].jaw_end;
    EXPECT_GT(closed, 0.1) << "the block is between them, " << young_modulus;
    for (int f = 0; f < 30; ++f) {
      report = move(simulation, low, low, 0, 0, 1.0 / 60);
      EXPECT_TRUE(
          is_within("pressure of jaws against grip_pressure", pressed() / pressure - 1, 0.1))
          << young_modulus;
      EXPECT_NEAR(report.input.tools[0].jaw_end, closed, 0.05) << young_modulus;
    }
    EXPECT_LT(most, 1.5 * pressure) << young_modulus;
  }
}

TYPED_TEST(GrasperOf, ClosedWithAllForceDoesNotMakeTissueBlowUp) {
  Scene scene = block_on_ground(5e3);
  scene.tools[0].grip_pressure = 1e6;
  scene = this->on_device(scene);
  Simulation simulation(scene);
  const Vec3 low(0, 0, 0.012), high(0.02, 0.01, 0.04);
  move(simulation, low, low, 1.8, 1.8, 0.1);
  FrameReport report = move(simulation, low, low, 0, 0, 1);
  if (scene.device == Device::kCpu) {  // 0.082 N, 499 substeps
    EXPECT_GT(report.result.loads[0].grip, 0.07);
    EXPECT_LT(report.result.substeps, 900);
  }
  report = move(simulation, low, high, 0, 0, 0.5);
  EXPECT_TRUE(std::isfinite(report.result.kinetic_energy));
  EXPECT_LT(report.result.max_speed, 5);
}

/// What a grasper gives to a free body, that body has: momentum, and its moment about the tip.
TYPED_TEST(GrasperOf, FeelsTheOppositeOfWhatItGives) {
  Scene scene = free_box(Vec3(0.02, 0.012, 0.016), 0.002);
  scene.tools = {grasper()};
  TypeParam tissue(scene);
  const std::vector<Vec3> home = homes(tissue.state());
  ToolMotion motion;
  motion.present = true;
  motion.begin = motion.end = pointing_down(Vec3(0.008, 0.004, 0.004));
  motion.begin.orientation = motion.end.orientation =
      motion.end.orientation * Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
  motion.jaw_end = 2.2f;
  Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
  double peak = 0, longest = 0;
  for (int f = 0; f < 20; ++f) {
    motion.jaw_begin = motion.jaw_end;
    motion.jaw_end -= 0.06f;
    const int n = 2 * static_cast<int>(std::ceil(kFrame / tissue.stable_substep()));
    advance_by(tissue, n, static_cast<float>(kFrame / n), {{&motion, 1}, {}});
    const ToolLoad load = tissue.finish().loads[0];
    impulse += kFrame * load.mean.force;
    moment += kFrame * load.mean.torque;
    peak = std::max(peak, load.peak_force);
    longest = std::max(longest, load.mean.force.norm());
  }
  pull(tissue);
  const Nodes& n = tissue.state().nodes;
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  for (std::size_t i = 0; i < n.size(); ++i) {
    const Vec3 at = home[i] + Vec3(n.u[0][i], n.u[1][i], n.u[2][i]) - motion.end.position;
    const Vec3 p = double(n.mass[i]) * Vec3(n.v[0][i], n.v[1][i], n.v[2][i]);
    linear += p;
    angular += at.cross(p);
  }
  EXPECT_GT(linear.norm(), 1e-5);
  EXPECT_LT((impulse + linear).norm(), 2e-3 * linear.norm());
  EXPECT_LT((moment + angular).norm(), 2e-3 * angular.norm());
  EXPECT_GE(peak, longest);
}

double nearest(const ToolPath& path, double share, const Vec3& place) {
  Collider jaws[2];
  path.at(share, jaws);
  const float x[3] = {float(place[0]), float(place[1]), float(place[2])};
  return std::min(gap(jaws[0], x).distance, gap(jaws[1], x).distance);
}

TEST(Jaws, MeetWhereTheToolIsWhenClosedAndOpenToBothSides) {
  const Tool tool = grasper();
  ToolMotion motion;
  motion.begin = motion.end = {Vec3(0.1, -0.2, 0.3),
                               Quat(Eigen::AngleAxisd(0.7, Vec3(3, -1, 2).normalized()))};
  const ToolPath closed(tool, 0, motion, kFrame, 1e-6);
  const Pose& pose = motion.end;
  for (const double z : {-0.014, -0.008, -0.003}) {
    EXPECT_NEAR(nearest(closed, 1, pose * Vec3(0, 0, z)), 0, 1e-7);
    EXPECT_NEAR(nearest(closed, 1, pose * Vec3(1e-3, 0, z)), -1e-3, 1e-7);
    EXPECT_NEAR(nearest(closed, 1, pose * Vec3(-1e-3, 0, z)), -1e-3, 1e-7);
    EXPECT_NEAR(nearest(closed, 1, pose * Vec3(3e-3, 0, z)), 1e-3, 1e-7);
    EXPECT_NEAR(nearest(closed, 1, pose * Vec3(0, -3e-3, z)), 1e-3, 1e-7);
  }
  EXPECT_NEAR(nearest(closed, 1, pose * Vec3(0, 0, 1e-3)), 1e-3, 1e-7) << "beyond the tip";
  motion.jaw_end = 1;
  const ToolPath opening(tool, 0, motion, kFrame, 1e-6);
  const Vec3 hinge(0, 0, -tool.jaw_length);
  for (const double share : {0.3, 1.0}) {
    for (const double side : {-0.5, 0.5}) {  // a place on a jaw's face, 10 mm from the hinge
      const Vec3 on = hinge + Vec3(std::sin(side * share), 0, std::cos(side * share)) * 0.01;
      EXPECT_NEAR(nearest(opening, share, pose * on), 0, 1e-7);
    }
    EXPECT_NEAR(nearest(opening, share, pose * (hinge + Vec3(0, 0, 0.01))),
                0.01 * std::sin(0.5 * share), 1e-7);
  }
}

TEST(Jaws, MoveAsFastAsTheirPlacesSay) {
  const Tool tool = grasper();
  ToolMotion motion;
  motion.begin = {Vec3(0.1, -0.2, 0.3), Quat(Eigen::AngleAxisd(0.7, Vec3(3, -1, 2).normalized()))};
  motion.end = {
      Vec3(0.102, -0.201, 0.301),
      Quat(Eigen::AngleAxisd(0.05, Vec3(1, 2, 0).normalized())) * motion.begin.orientation};
  motion.jaw_begin = 1;
  motion.jaw_end = 0.9f;
  const ToolPath path(tool, 0, motion, kFrame, 1e-6);
  Collider now[2], soon[2];
  const double step = 0.02;
  path.at(0.5 - step / 2, now);
  path.at(0.5 + step / 2, soon);
  for (int side = 0; side < 2; ++side) {
    const float local[3] = {-0.001f, 0.0005f, -0.004f};
    float a[3], b[3], middle[3], velocity[3];
    to_world(now[side], local, a);
    to_world(soon[side], local, b);
    Collider between[2];
    path.at(0.5, between);
    to_world(between[side], local, middle);
    velocity_at(between[side], middle, velocity);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR((b[i] - a[i]) / (step * kFrame), velocity[i], 2e-3) << side;  // of 0.2 m/s
    }
  }
}

TEST(Grip, FollowsTheAngleWhereNothingIsHeldNoFasterThanAMotor) {
  Grip grip;
  ToolMotion motion;
  motion.jaw_begin = 1;
  motion.jaw_end = 0.99f;
  grip.limit(2000, kFrame, motion);
  EXPECT_EQ(motion.jaw_end, 0.99f);
  motion.jaw_end = -1;
  grip.limit(2000, kFrame, motion);
  EXPECT_NEAR(motion.jaw_end, 1 - 3 * kFrame, 1e-6);
  motion.jaw_end = 5;
  grip.limit(2000, kFrame, motion);
  EXPECT_NEAR(motion.jaw_end, 1 + 3 * kFrame, 1e-6);
  motion.jaw_begin = 0.01f;
  motion.jaw_end = -0.3f;
  grip.limit(2000, kFrame, motion);
  EXPECT_EQ(motion.jaw_end, 0) << "closed is closed";
}

TEST(Grip, LimitsWhatWasLimitedNoFurther) {
  Grip grip;
  ToolMotion motion;
  motion.jaw_begin = 0.5f;
  motion.jaw_end = 0.48f;
  grip.follow(motion, 800);
  motion.jaw_begin = 0.48f;
  motion.jaw_end = 0;
  grip.limit(2000, kFrame, motion);
  const float limited = motion.jaw_end;
  EXPECT_GT(limited, 0.43f);
  EXPECT_LT(limited, 0.48f);
  grip.limit(2000, kFrame, motion);
  EXPECT_EQ(motion.jaw_end, limited);
}

}  // namespace
}  // namespace tissue_sim
