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

// Tetrahedra had none: what was cut by strokes to and fro swung for ten seconds.
TEST(ViscosityOfTetrahedra, DampsShearAsItsMaterialAsksAndKeepsMomentum) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.device = Device::kCpu;
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.cell_size = 0.005;
  scene.ground.enabled = false;
  Material thick = find_material(scene, "liver");
  thick.name = "thick";
  thick.viscosity = kViscosity;
  scene.materials = {thick};
  scene.bodies.resize(1);
  scene.bodies[0].material = "thick";
  scene.bodies[0].size = Vec3(0.08, 0.06, 0.06);
  Simulation simulation(scene);
  auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
  pbd::Vertices& v = tissue.state().vertices;
  const double k = 2 * M_PI / 0.04;
  const auto wave = [&](int i) { return std::sin(k * v.reference[i].x()); };
  for (int i = 0; i < v.size(); ++i) {
    v.v[4 * i] = 0.1f;
    v.v[4 * i + 1] = static_cast<float>(wave(i));
  }
  const Momentum before = tissue.momentum();
  constexpr double kDuration = 0.01;
  pbd::damp_neighbours(tissue.state(), kDuration);
  double sum = 0, had = 0;  // where neighbours are on all sides
  for (int i = 0; i < v.size(); ++i) {
    if ((v.reference[i].cwiseAbs() - Vec3(0.03, 0.02, 0.02)).maxCoeff() > 0) continue;
    sum += v.mass[i] * wave(i) * v.velocity(i).y();
    had += v.mass[i] * wave(i) * wave(i);
  }
  const double rate = -std::log(sum / had) / kDuration;
  const double asked = kViscosity * k * k / thick.density;
  EXPECT_NEAR(rate, asked, 0.25 * asked);
  const Momentum after = tissue.momentum();
  EXPECT_LT((after.linear - before.linear).norm(), 1e-6 * before.mass);
  EXPECT_LT((after.angular - before.angular).norm(), 1e-6 * before.mass * 0.04);
}

TEST(ViscosityOfTetrahedra, WhatZigzagStrokesCutComesToRest) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.device = Device::kCpu;
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.cell_size = 0.006;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.08, 0.06, 0.03);
  scene.bodies[0].pose.position.z() = 0.0151;
  scene.tools.resize(1);
  scene.tools[0].type = ToolType::kScalpel;
  Simulation simulation(scene);
  const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  constexpr int kStrokes = 160;
  double late = 0;
  for (int frame = 0; frame < kStrokes + 150; ++frame) {
    const double share = std::min(1.0, frame / double{kStrokes});
    const double y = 0.025 * std::asin(std::sin(16 * M_PI * share)) * 2 / M_PI;
    simulation.set_tool(
        0, {frame < kStrokes ? Vec3(0.09 * share - 0.045, y, 0.012) : Vec3(0, 0, 0.2), down});
    const FrameResult result = simulation.advance_frame().result;
    if (frame >= kStrokes + 120) late = std::max(late, result.max_speed);
  }
  EXPECT_GT(simulation.tissue().fragments().size(), 3u);
  std::printf("two seconds after the strokes %.3f m/s\n", late);
  EXPECT_LT(late, 0.02);
}

}  // namespace
}  // namespace tissue_sim
