// Linear and angular momentum of a body in free flight, with and without a cut on the way.
#include "momentum.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "curve_file.h"
#include "mpm/mpm_tissue.h"

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

/// A plane across the block wherever it has flown to; through its middle, askew.
BladePath cut_through(const MpmState& state, const std::vector<Vec3>& home) {
  double mass = 0;
  Vec3 center = Vec3::Zero();
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 u(state.nodes.u[0][i], state.nodes.u[1][i], state.nodes.u[2][i]);
    center += state.nodes.mass[i] * (home[i] + u);
    mass += state.nodes.mass[i];
  }
  center /= mass;
  BladePath path;
  path.edge = {Vec3(0.02, -0.1, 0), Vec3(-0.02, 0.1, 0)};
  path.poses.resize(2);
  path.poses[0].position = center + Vec3(0, 0, -0.1);
  path.poses[1].position = center + Vec3(0, 0, 0.1);
  return path;
}

struct Flight {
  double linear = 0, angular = 0;  ///< largest change, relative
  std::size_t pieces = 0;
  double energy_before = 0, energy_after = 0;  ///< kinetic and elastic, around the cut [J]
  double elastic_share = 0;                    ///< largest share of the energy that is elastic
};

/// 10 000 substeps, sampled every 100; cuts before number `cut_at`.
Flight fly(Law law, int cut_at, const std::string& curve) {
  MpmTissue tissue(block_in_flight(law));
  MpmState& state = tissue.state();
  throw_it(state);
  std::vector<Vec3> home = homes(state);
  const Momentum start = momentum(state, home);
  CurveFile file(curve, "substep,linear,angular");
  Flight flight;
  for (int i = 0; i < 10000; i += 100) {
    if (i == cut_at) {
      const BladePath path = cut_through(state, home);
      tissue.advance(0, 0, {{}, {}});
      const FrameResult before = tissue.finish();
      tissue.advance(0, 0, {{}, {&path, 1}});
      const FrameResult after = tissue.finish();
      flight.energy_before = before.kinetic_energy + before.elastic_energy;
      flight.energy_after = after.kinetic_energy + after.elastic_energy;
      home = homes(state);
    }
    tissue.advance(100, tissue.stable_substep(), {});
    const FrameResult result = tissue.finish();
    EXPECT_FALSE(result.blew_up);
    flight.elastic_share =
        std::max(flight.elastic_share,
                 result.elastic_energy / (result.elastic_energy + result.kinetic_energy));
    const Momentum now = momentum(state, home);
    const double linear = (now.linear - start.linear).norm() / start.linear.norm();
    const double angular = (now.angular - start.angular).norm() / start.angular.norm();
    file.add({i + 100.0, linear, angular});
    flight.linear = std::max(flight.linear, linear);
    flight.angular = std::max(flight.angular, angular);
  }
  flight.pieces = tissue.fragments().size();
  return flight;
}

TEST(Momentum, StaysInFreeFlight) {
  for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    const Flight flight = fly(law, -1, law == Law::kFixedCorotated ? "momentum_whole" : "");
    EXPECT_EQ(flight.pieces, 1u);
    EXPECT_LT(flight.linear, 3e-5);
    EXPECT_LT(flight.angular, 3e-5);
    EXPECT_GT(flight.elastic_share, 0.1);  // it rings
  }
}

TEST(Momentum, StaysThroughACutAsWithoutOne) {
  const Flight flight = fly(Law::kFixedCorotated, 5000, "momentum_cut");
  EXPECT_EQ(flight.pieces, 2u);
  EXPECT_LT(flight.linear, 3e-5);
  EXPECT_LT(flight.angular, 3e-5);
  // The new nodes take their parents' motion, so nothing jumps, save that cells the cut left in
  // parts are stabilised from then on, which counts as elastic.
  EXPECT_NEAR(flight.energy_after / flight.energy_before, 1, 1e-3);
}

TEST(Momentum, GrowsByTheWeightOfWhatFalls) {
  Scene scene = block_in_flight(Law::kFixedCorotated);
  scene.gravity = Vec3(0, 0, -9.81);
  MpmTissue tissue(scene);
  throw_it(tissue.state());
  const std::vector<Vec3> home = homes(tissue.state());
  const Momentum start = momentum(tissue.state(), home);
  const double mass = 1060 * 0.04 * 0.032 * 0.024;
  double time = 0;
  for (int i = 0; i < 10; ++i) {
    const float dt = tissue.stable_substep();
    tissue.advance(100, dt, {});
    tissue.finish();
    time += 100.0 * dt;
    const Momentum now = momentum(tissue.state(), home);
    const Vec3 gained = now.linear - start.linear;
    EXPECT_LT((gained - mass * time * scene.gravity).norm() / gained.norm(), 3e-5) << time;
    EXPECT_LT((now.angular - start.angular).norm() / start.angular.norm(), 3e-5) << time;
  }
}

}  // namespace
}  // namespace tissue_sim
