// Linear and angular momentum of a body that a tool struck and that then flies freely, with and
// without cuts on the way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "support/cut_paths.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.032, 0.024);
constexpr int kStrike = 14, kFlight = 240;  // sixtieths of a second; some 10 000 substeps

/// A block of liver in free space, and a probe that strikes it aside of its middle.
Scene struck_block(Law law) {
  Scene s = free_box(kSize, 0.004);
  s.bodies[0].pose.position = Vec3::Zero();
  s.materials.resize(1);
  s.materials[0].law = law;
  s.bodies[0].material = s.materials[0].name;
  s.tools.resize(1);
  s.tools[0].radius = 0.006;
  s.tools[0].friction = 0.5;
  return s;
}

/// The probe comes along x, goes 10 mm deep at half a metre a second, and leaves for good. `time`
/// is in sixtieths of a second.
Pose probe_at(double time) {
  const double x = time < 3 ? -0.038 + 0.008 * time : -0.014 - 0.008 * (time - 3);
  return {Vec3(x, 0.011, 0.008), Quat::FromTwoVectors(Vec3::UnitZ(), Vec3(1, 0.2, -0.1))};
}

/// Centre of mass of a body of one density.
Vec3 center(Simulation& simulation) {
  Vec3 centroid = Vec3::Zero();
  double volume = 0;
  for (const Fragment& f : simulation.tissue().fragments()) {
    centroid += f.volume * f.centroid;
    volume += f.volume;
  }
  return centroid / volume;
}

/// Angular momentum about the centre of mass.
Vec3 spin_of(const Momentum& m) { return m.angular; }

struct Strike {
  Vec3 impulse = Vec3::Zero(),
       moment = Vec3::Zero();  ///< of the probe on the body, about the origin
};

Strike strike(Simulation& simulation) {
  Strike sum;
  const double frame = 1 / simulation.scene().frame_rate;
  Pose before = probe_at(0);
  for (int f = 0; f * frame * 60 < kStrike; ++f) {
    const Pose now = probe_at(f * frame * 60);
    simulation.set_tool(0, now);
    const Wrench felt = simulation.advance_frame().result.loads[0].mean;
    const Vec3 tip = 0.5 * (before.position + now.position);
    sum.impulse -= frame * felt.force;
    sum.moment -= frame * (tip.cross(felt.force) + felt.torque);
    before = now;
  }
  return sum;
}

struct Flight;
class MomentumOf : public EachMethod {
 protected:
  void expect_kept(const std::string& how, const Flight& flight) const;
};
FOR_EACH_METHOD(MomentumOf);

TEST_P(MomentumOf, AStruckBodyIsWhatTheToolGaveIt) {
  Scene scene = on_this(struck_block(Law::kFixedCorotated));
  scene.frame_rate = 480;  // a load is about where the tip is, which moves
  Simulation simulation(scene);
  EXPECT_NEAR(simulation.tissue().momentum().mass / (1060 * kSize.prod()), 1, 1e-5);
  const Strike given = strike(simulation);
  const FrameResult last = simulation.advance_frame().result;
  EXPECT_EQ(last.loads[0].peak_force, 0) << "it still touches";
  const Momentum m = simulation.tissue().momentum();
  EXPECT_GT(m.linear[0], 1e-3);
  EXPECT_GT(m.angular.norm(), 5e-6);
  EXPECT_TRUE(is_at_most("a probe's impulse against the body's momentum",
                         (m.linear - given.impulse).norm() / m.linear.norm(), within().impulse));
  const Vec3 about_origin = m.angular + m.centre.cross(m.linear);
  EXPECT_TRUE(is_at_most("the same of moments",
                         (about_origin - given.moment).norm() / about_origin.norm(),
                         within().angular_impulse));
}

/// Cuts before a frame of the flight, about the centre of mass.
struct CutInFlight {
  int frame;
  BladePath path;
};

struct Flight {
  double linear = 0, angular = 0;  ///< largest change, relative
  double elastic_share = 0;        ///< largest share of the energy that is elastic
  double energy_gain = 0;          ///< largest, over what it had at the beginning, relative
  std::size_t pieces = 0;
};

Flight fly(const Scene& scene, const std::vector<CutInFlight>& cuts) {
  Simulation simulation(scene);
  strike(simulation);
  FrameResult r = simulation.advance_frame().result;
  const double energy = r.kinetic_energy + r.elastic_energy;
  const Momentum start = simulation.tissue().momentum();
  const Vec3 spin = spin_of(start);
  Flight flight;
  for (int f = 0; f < kFlight; ++f) {
    for (const CutInFlight& cut : cuts) {
      if (cut.frame != f) continue;
      const Vec3 middle = center(simulation);
      BladePath path = cut.path;
      for (Pose& pose : path.poses) pose.position += middle;
      simulation.cut(path);
    }
    r = simulation.advance_frame().result;
    for (const CutReport& report : r.cut_reports) EXPECT_GT(report.bonds_broken, 0) << f;
    const Momentum now = simulation.tissue().momentum();
    flight.linear = std::max(flight.linear, (now.linear - start.linear).norm());
    flight.angular = std::max(flight.angular, (spin_of(now) - spin).norm());
    const double now_energy = r.kinetic_energy + r.elastic_energy;
    flight.elastic_share = std::max(flight.elastic_share, r.elastic_energy / now_energy);
    flight.energy_gain = std::max(flight.energy_gain, now_energy / energy - 1);
  }
  flight.linear /= start.linear.norm();
  flight.angular /= spin.norm();
  flight.pieces = simulation.tissue().fragments().size();
  std::printf("%.1e and %.1e of linear and angular momentum, %.2f elastic, %.1e of energy gained\n",
              flight.linear, flight.angular, flight.elastic_share, flight.energy_gain);
  return flight;
}

BladePath stroke(const Vec3& a, const Vec3& b, const std::vector<Vec3>& places) {
  BladePath path;
  path.edge = {a, b};
  for (const Vec3& place : places) path.poses.push_back({place, Quat::Identity()});
  return path;
}

/// A plane through the middle, askew.
BladePath in_two() {
  return stroke(Vec3(0.02, -0.1, 0), Vec3(-0.02, 0.1, 0), {Vec3(0, 0, -0.1), Vec3(0, 0, 0.1)});
}

void MomentumOf::expect_kept(const std::string& how, const Flight& flight) const {
  EXPECT_TRUE(is_at_most("linear momentum " + how, flight.linear, within().momentum));
  EXPECT_TRUE(is_at_most("angular momentum " + how, flight.angular, within().momentum));
  EXPECT_TRUE(is_at_most("energy gained " + how, flight.energy_gain, 0.03, "%"));
}

TEST_P(MomentumOf, FreeFlightStays) {
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    const Flight flight = fly(on_this(struck_block(law)), {});
    EXPECT_EQ(flight.pieces, 1u);
    expect_kept("in flight", flight);
    EXPECT_GT(flight.elastic_share, 0.01);  // it rings
  }
}

TEST_P(MomentumOf, FreeFlightStaysThroughCutsAsWithoutThem) {
  const Vec3 up(0, 0, 0.1);
  std::vector<Vec3> wave;
  for (int i = 0; i <= 30; ++i) {
    const double s = i / 30.0;
    wave.push_back(Vec3(0.006 * std::sin(12 * s), 0.1 * (s - 0.5), 0));
  }
  const std::vector<CutInFlight> cuts = {
      {20, stroke(-up, up, {Vec3(0.005, -0.1, 0), Vec3(0.005, 0, 0)})},  // ends inside
      {50, stroke(-up, up, {Vec3(-0.01, 0, 0), Vec3(-0.002, 0, 0)})},    // begins inside, too
      {80, stroke(-up, up, wave)},
      {120, in_two()},
      {121, stroke(Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), {Vec3(0, -0.1, 0.002), Vec3(0, 0.1, 0)})},
  };
  const Flight flight = fly(on_this(struck_block(Law::kFixedCorotated)), cuts);
  EXPECT_GT(flight.pieces, 4u);
  expect_kept("in flight and cut", flight);
}

TEST_P(MomentumOf, WhatFallsGrowsByItsWeight) {
  Scene scene = on_this(struck_block(Law::kFixedCorotated));
  scene.gravity = Vec3(0.2, -0.1, -0.6);  // the probe is to strike it
  Simulation simulation(scene);
  strike(simulation);
  simulation.advance_frame();
  const Momentum start = simulation.tissue().momentum();
  const Vec3 spin = spin_of(start);
  EXPECT_GT(spin.norm(), 5e-6);
  const double began = simulation.time();
  for (int f = 0; f < 60; ++f) {
    const FrameResult r = simulation.advance_frame().result;
    const Momentum now = simulation.tissue().momentum();
    const Vec3 gained = now.linear - start.linear;
    const Vec3 weight = now.mass * scene.gravity;
    // Velocities may belong to the middles of substeps, whose lengths change.
    EXPECT_LT((gained - weight * (simulation.time() - began)).norm(),
              within().momentum * gained.norm() + 0.5 * r.substep * weight.norm());
    EXPECT_LT((spin_of(now) - spin).norm(), 1e-3 * spin.norm()) << f;
  }
}

}  // namespace
}  // namespace tissue_sim
