// What is cut is viscous: neighbours lose what they move by against one another, and no momentum.
#include "pbd/viscosity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pbd/free_flight.h"
#include "pbd/pbd_tissue.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

constexpr double kViscosity = 2;  // [Pa s]

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
    Material thick = find_material(scene, "liver");
    thick.name = "thick";
    thick.viscosity = kViscosity;
    scene.materials = {thick};
    scene.bodies.resize(1);
    scene.bodies[0].material = "thick";
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

// Edge by edge in double precision, in the order of colours.
TEST_F(Viscosity, IsADashpotAtEachEdge) {
  const auto motion = [](int i) { return Vec3(std::sin(7.0 * i), std::sin(5.0 * i + 1), 0.1); };
  set_velocities(motion);
  pbd::State& s = tissue().state();
  const std::vector<pbd::Flight> before = pbd::flights(s);
  std::vector<Vec3> spins, v;
  for (const pbd::Flight& f : before) spins.push_back(pbd::spin_of(f, f.angular));
  int colours = 0;
  for (int c = 0; c < s.edge_count; ++c) colours = std::max<int>(colours, s.links.colour[c] + 1);
  for (int i = 0; i < s.vertices.size(); ++i) v.push_back(s.vertices.velocity(i));
  constexpr double kDuration = 1.0 / 60;
  for (int colour = 0; colour < colours; ++colour) {
    for (int c = 0; c < s.edge_count; ++c) {
      if (s.links.colour[c] != colour) continue;
      const auto [a, b] = s.links.vertices[c];
      const double wa = 1 / s.vertices.mass[a], wb = 1 / s.vertices.mass[b];
      const double length = (s.vertices.reference[b] - s.vertices.reference[a]).norm();
      const double uneven = (wa + wb) * (wa + wb) / (4 * wa * wb);
      const double rate = std::max(80.0, kViscosity / (1000 * length * length));
      const double lost = 1 - std::exp(-rate * kDuration * uneven);
      const Vec3 way = s.vertices.position(b) - s.vertices.position(a);
      const Vec3 by = lost * (v[b] - v[a] - spins[s.component[a]].cross(way)) / (wa + wb);
      v[a] += wa * by;
      v[b] -= wb * by;
    }
  }
  std::vector<Vec3> angular(spins.size(), Vec3::Zero());
  for (int i = 0; i < s.vertices.size(); ++i) {
    const pbd::Flight& f = before[s.component[i]];
    angular[s.component[i]] += s.vertices.mass[i] * (s.vertices.position(i) - f.centre).cross(v[i]);
  }
  pbd::damp_neighbours(s, kDuration);
  double off = 0, lost = 0;
  for (int i = 0; i < s.vertices.size(); ++i) {
    const std::int32_t c = s.component[i];
    const pbd::Flight& f = before[c];
    const Vec3 back = pbd::spin_of(f, f.angular - angular[c]);
    const Vec3 expected = v[i] + back.cross(s.vertices.position(i) - f.centre);
    off = std::max(off, (s.vertices.velocity(i) - expected).norm());
    lost = std::max(lost, (motion(i) - expected).norm());
  }
  EXPECT_GT(lost, 0.5);
  EXPECT_LT(off, 1e-5);
}

}  // namespace
}  // namespace tissue_sim
