// What is cut is viscous: neighbours lose what they move by against one another, and no momentum.
#include "pbd/viscosity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pbd/pbd_tissue.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

class Viscosity : public testing::Test {
 protected:
  Viscosity() : simulation_(scene()) {
    BladePath path;
    path.edge = {Vec3(0, 0, -0.1), Vec3(0, 0, 0.1)};
    path.poses = {{Vec3(0.01, -0.1, 0), Quat::Identity()}, {Vec3(0.01, 0.1, 0), Quat::Identity()}};
    simulation_.cut(path);
    simulation_.advance_frame();
  }
  static Scene scene() {
    Scene scene;
    scene.method = Method::kPbd;
    scene.cell_size = 0.006;
    scene.gravity = Vec3::Zero();
    scene.ground.enabled = false;
    scene.bodies.resize(1);
    scene.bodies[0].shape = Shape::kEllipsoid;
    scene.bodies[0].radii = Vec3(0.055, 0.031, 0.020);
    return scene;
  }
  PbdTissue& tissue() { return static_cast<PbdTissue&>(simulation_.tissue()); }
  double energy() {
    const pbd::Vertices& v = tissue().state().vertices;
    double sum = 0;
    for (int i = 0; i < v.size(); ++i) sum += 0.5 * v.mass[i] * v.velocity(i).squaredNorm();
    return sum;
  }
  template <class F>
  void set_velocities(const F& of) {
    pbd::Vertices& v = tissue().state().vertices;
    for (int i = 0; i < v.size(); ++i) {
      const Vec3 speed = of(i);
      for (int a = 0; a < 3; ++a) v.v[4 * i + a] = static_cast<float>(speed[a]);
    }
  }

  Simulation simulation_;
};

TEST_F(Viscosity, ARigidMotionOfEachPieceStays) {
  const pbd::State& s = tissue().state();
  ASSERT_GT(s.components, 1);
  const auto motion = [&s](int i) {
    const double sign = s.component[i] == 0 ? 1 : -2;
    return Vec3(sign * Vec3(1, 2, 3).cross(s.vertices.position(i)) + Vec3(0.1, 0, sign));
  };
  set_velocities(motion);
  pbd::damp_neighbours(tissue().state(), 1.0 / 60);
  double most = 0;
  for (int i = 0; i < s.vertices.size(); ++i) {
    most = std::max(most, (s.vertices.velocity(i) - motion(i)).norm());
  }
  EXPECT_LT(most, 1e-5);  // of metres a second
}

TEST_F(Viscosity, WhatMovesToAndFroIsLostAndNoMomentum) {
  set_velocities(
      [](int i) { return Vec3(std::sin(7.0 * i), std::sin(5.0 * i + 1), std::sin(3.0 * i + 2)); });
  const Momentum before = tissue().momentum();
  const double had = energy();
  pbd::damp_neighbours(tissue().state(), 1.0 / 60);
  const Momentum after = tissue().momentum();
  EXPECT_LT(energy(), 0.7 * had);
  EXPECT_LT((after.linear - before.linear).norm(), 1e-6 * before.mass);
  EXPECT_LT((after.angular - before.angular).norm(), 1e-6 * before.mass * 0.055);
}

}  // namespace
}  // namespace tissue_sim
