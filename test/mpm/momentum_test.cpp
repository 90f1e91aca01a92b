// Linear and angular momentum of a body in free flight, with and without a cut on the way.
#include "support/momentum.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "mpm/mpm_tissue.h"
#include "support/curve_file.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"

namespace tissue_sim {
namespace {

/// A block of liver that tumbles: it flies, spins about no axis of its own, and its lower half sets
/// off twisted against the upper, so that it rings all the way.
Scene block_in_flight(Law law) {
  Scene s;
  s.cell_size = 0.004;
  s.gravity = Vec3::Zero();
  s.ground.enabled = false;
  s.materials.resize(1);
  s.materials[0].law = law;
  s.bodies.resize(1);
  s.bodies[0].size = Vec3(0.04, 0.032, 0.024);
  return s;
}

void throw_it(MpmState& state) {
  const std::vector<Vec3> home = homes(state);
  const Vec3 flight(0.1, -0.06, 0.08), spin(3, 5, -4);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 twist(0, 0, home[i].z() < 0 ? 8 : -8);
    const Vec3 v = flight + (spin + twist).cross(home[i]);
    for (int c = 0; c < 3; ++c) state.nodes.v[c][i] = static_cast<float>(v[c]);
  }
}

/// A cut on the way; the path is about the centre of mass, wherever that has flown to.
struct CutInFlight {
  int at;  ///< number of the substep, a multiple of 100
  BladePath path;
};

/// A straight edge that passes these places.
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

struct Flight {
  double linear = 0, angular = 0;  ///< largest change, relative
  std::size_t pieces = 0;
  double energy_ratio = 0;   ///< kinetic and elastic, largest after over before a cut
  double elastic_share = 0;  ///< largest share of the energy that is elastic
};

/// Pieces fly apart: what goes through the middle of all may pass between them.
Vec3 middle_of_largest(MpmTissue& tissue) {
  const Span<const Fragment> all = tissue.fragments();
  return std::max_element(all.begin(), all.end(),
                          [](const Fragment& a, const Fragment& b) { return a.volume < b.volume; })
      ->centroid;
}

/// 10 000 substeps, sampled every 100.
Flight fly(Law law, const std::vector<CutInFlight>& cuts, const std::string& curve) {
  MpmTissue tissue(block_in_flight(law));
  MpmState& state = tissue.state();
  throw_it(state);
  const Momentum start = momentum(state);
  CurveFile file(curve, "substep,linear,angular");
  Flight flight;
  for (int i = 0; i < 10000; i += 100) {
    for (const CutInFlight& cut : cuts) {
      if (i != cut.at) continue;
      BladePath path = cut.path;
      for (Pose& pose : path.poses) pose.position += middle_of_largest(tissue);
      advance_by(tissue, 0, 0, {{}, {}});
      const FrameResult before = tissue.finish();
      advance_by(tissue, 0, 0, {{}, {&path, 1}});
      const FrameResult after = tissue.finish();
      EXPECT_GT(after.cut_reports[0].bonds_broken, 0) << "cut before substep " << i;
      flight.energy_ratio =
          std::max(flight.energy_ratio, (after.kinetic_energy + after.elastic_energy) /
                                            (before.kinetic_energy + before.elastic_energy));
    }
    advance_by(tissue, 100, tissue.stable_substep(), {});
    const FrameResult result = tissue.finish();
    EXPECT_FALSE(result.blew_up);
    flight.elastic_share =
        std::max(flight.elastic_share,
                 result.elastic_energy / (result.elastic_energy + result.kinetic_energy));
    const Momentum now = momentum(state);
    const double linear = (now.linear - start.linear).norm() / start.linear.norm();
    const double angular = (now.angular - start.angular).norm() / start.angular.norm();
    file.add({i + 100.0, linear, angular});
    flight.linear = std::max(flight.linear, linear);
    flight.angular = std::max(flight.angular, angular);
  }
  flight.pieces = tissue.fragments().size();
  return flight;
}

void expect_kept(const std::string& how, const Flight& flight) {
  EXPECT_TRUE(is_at_most(how + ": linear momentum", flight.linear, 3e-5));
  EXPECT_TRUE(is_at_most(how + ": angular", flight.angular, 3e-5));
}

TEST(Momentum, StaysInFreeFlight) {
  for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    const Flight flight = fly(law, {}, law == Law::kFixedCorotated ? "momentum_whole" : "");
    EXPECT_EQ(flight.pieces, 1u);
    expect_kept("10 000 substeps of flight", flight);
    EXPECT_GT(flight.elastic_share, 0.1);  // it rings
  }
}

TEST(Momentum, StaysThroughACutAsWithoutOne) {
  const Flight flight = fly(Law::kFixedCorotated, {{5000, in_two()}}, "momentum_cut");
  EXPECT_EQ(flight.pieces, 2u);
  expect_kept("the same, cut in two", flight);
  // The new nodes take their parents' motion, so nothing jumps, save that cells the cut left in
  // parts are stabilised from then on, which counts as elastic.
  EXPECT_NEAR(flight.energy_ratio, 1, 1e-3);
}

TEST(Momentum, StaysThroughPartialCurvedAndManyCuts) {
  const Vec3 up(0, 0, 0.1);
  std::vector<Vec3> wave, ring;
  for (int i = 0; i <= 30; ++i) {
    const double s = i / 30.0, angle = 2 * M_PI * (i % 30) / 30;
    wave.push_back(Vec3(0.006 * std::sin(12 * s), 0.1 * (s - 0.5), 0));
    ring.push_back(0.009 * Vec3(std::cos(angle), std::sin(angle), 0));
  }
  const std::vector<CutInFlight> cuts = {
      {1000, stroke(-up, up, {Vec3(0.005, -0.1, 0), Vec3(0.005, 0, 0)})},  // ends inside
      {2000, stroke(-up, up, {Vec3(-0.01, 0, 0), Vec3(-0.002, 0, 0)})},    // begins inside, too
      {3000, stroke(-up, up, wave)},
      {3100, stroke(-up, up, ring)},
      {5000, in_two()},
      {3200, stroke(Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), {Vec3(0, -0.1, 0.002), Vec3(0, 0.1, 0)})},
  };
  const Flight flight = fly(Law::kFixedCorotated, cuts, "momentum_cuts");
  EXPECT_GT(flight.pieces, 6u);
  expect_kept("six cuts (wave, ring, planes, in part)", flight);
  EXPECT_NEAR(flight.energy_ratio, 1, 5e-3);
  std::printf("%zu pieces, %.1e and %.1e of linear and angular momentum\n", flight.pieces,
              flight.linear, flight.angular);
}

TEST(Momentum, GrowsByTheWeightOfWhatFalls) {
  Scene scene = block_in_flight(Law::kFixedCorotated);
  scene.gravity = Vec3(0, 0, -9.81);
  MpmTissue tissue(scene);
  throw_it(tissue.state());
  const Momentum start = momentum(tissue.state());
  const double mass = 1060 * 0.04 * 0.032 * 0.024;
  double time = 0, half_before = 0.5 * tissue.stable_substep();
  for (int i = 0; i < 10; ++i) {
    const float dt = tissue.stable_substep();
    advance_by(tissue, 100, dt, {});
    tissue.finish();
    time += half_before + 99.5 * dt;  // velocities belong to the middles of substeps
    half_before = 0.5 * dt;
    const Momentum now = momentum(tissue.state());
    const Vec3 gained = now.linear - start.linear;
    EXPECT_LT((gained - mass * time * scene.gravity).norm() / gained.norm(), 3e-5) << time;
    EXPECT_LT((now.angular - start.angular).norm() / start.angular.norm(), 3e-5) << time;
  }
}

}  // namespace
}  // namespace tissue_sim
