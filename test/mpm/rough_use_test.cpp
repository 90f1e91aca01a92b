// What instruments do to tissue when they are not careful: it may be hurt, but must not blow up.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "mpm/cut_tissue.h"
#include "mpm/mpm_tissue.h"
#include "mpm/tear/debris.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/momentum.h"
#include "support/stability_limit.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

struct Jabs {
  Law law;
  double viscosity, poisson_ratio;
  double speed;  ///< of the probe [m/s]
};

/// A probe is jabbed about in tissue on the ground, down to the ground at times, while a scalpel
/// cuts slices of it. The fastest jab throws it away at half a metre a second; the scalpel follows.
TEST(RoughUse, JabsDoNotBlowTissueUp) {
  int seed = 0;
  for (const Jabs& jabs : std::vector<Jabs>{{Law::kFixedCorotated, 0, 0.3, 0.36},
                                            {Law::kFixedCorotated, 0, 0.45, 0.72},
                                            {Law::kFixedCorotated, 1, 0.45, 0.18},
                                            {Law::kNeoHookean, 0, 0.49, 0.36},
                                            {Law::kNeoHookean, 1, 0.3, 0.18},
                                            {Law::kNeoHookean, 1, 0.3, 0.36}}) {
    Scene s = free_box(Vec3(0.06, 0.05, 0.03), 0.004);
    s.bodies[0].pose.position = Vec3(0, 0, 0.0155);
    s.gravity = Vec3(0, 0, -9.81);
    s.ground.enabled = true;
    Material& m = s.materials.emplace_back();
    m.name = s.bodies[0].material = "jabbed";
    m.law = jabs.law;
    m.young_modulus = 4000;
    m.poisson_ratio = jabs.poisson_ratio;
    m.viscosity = jabs.viscosity;
    s.tools.resize(2);
    s.tools[0].name = "probe";
    s.tools[0].radius = 0.006;
    s.tools[1].name = "scalpel";
    s.tools[1].type = ToolType::kScalpel;
    s.tools[1].blade_length = 0.04;
    Simulation simulation(s);
    std::mt19937 random(++seed);
    std::uniform_real_distribution<double> u(-1, 1);
    const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
    const Vec3 low(-0.03, -0.025, 0.006), high(0.03, 0.025, 0.045);
    Vec3 probe(0, 0, 0.04), direction = -Vec3::UnitZ();
    for (int frame = 0; frame < 90; ++frame) {
      if (frame % 5 == 0) direction = Vec3(u(random), u(random), u(random) - 0.2).normalized();
      probe = (probe + jabs.speed / 60 * direction).cwiseMax(low).cwiseMin(high);
      const Vec3 centre = simulation.tissue().momentum().centre;
      const Vec3 scalpel(centre[0] + 0.02 - 0.02 * (frame / 30),
                         centre[1] + 0.04 - 0.08 * (frame % 30) / 30.0, -0.001);
      simulation.set_tool(0, {probe, down});
      simulation.set_tool(1, {scalpel, down});
      ASSERT_FALSE(simulation.advance_frame().result.blew_up) << "case " << seed << ", " << frame;
    }
    EXPECT_GT(simulation.tissue().fragments().size(), 1u);
  }
}

/// Nodes of a shattered body are set going at random, under the substep that would be chosen.
TEST(RoughUse, ViscosityOnlyTakesEnergyHoweverTissueIsCut) {
  for (const double viscosity : {1.0, 10.0}) {
    Scene scene = soft_body(0.3, Vec3(6, 6, 6));
    scene.materials[0].viscosity = viscosity;
    MpmTissue tissue(scene);
    const std::vector<BladePath> planes = random_planes(30, 0.012);
    advance_by(tissue, 0, 0, {{}, planes});
    tissue.finish();
    Nodes& n = tissue.state().nodes;
    std::mt19937 random(3);
    std::normal_distribution<float> normal(0, 1e-3f);
    for (std::size_t i = 0; i < n.size(); ++i) {
      for (auto& v : n.v) v[i] = n.inv_mass[i] > 0 ? normal(random) : 0;
    }
    measure_motion(tissue.state());
    const double start = tissue.finish().kinetic_energy;
    double energy = start;
    for (int i = 0; i < 20; ++i) {
      advance_by(tissue, 20, tissue.substep_for({}), {});
      const FrameResult r = tissue.finish();
      energy = r.kinetic_energy + r.elastic_energy;
      ASSERT_LT(energy, 1.02 * start) << viscosity << ", " << i;
    }
    EXPECT_LT(energy, 0.8 * start);
  }
}

/// Shatters a body that is stretched and spins.
TEST(RoughUse, DebrisMovesOnAsRigidBodies) {
  MpmTissue tissue(free_box(Vec3(0.024, 0.018, 0.018), 0.003));
  MpmState& s = tissue.state();
  std::vector<Vec3> home = homes(s);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 u = Vec3(0.3, -0.1, 0.1).cwiseProduct(home[i]);
    const Vec3 v = Vec3(0.2, -0.1, 0.3) + Vec3(5, 8, 3).cross(home[i] + u);
    for (int a = 0; a < 3; ++a) {
      s.nodes.u[a][i] = static_cast<float>(u[a]);
      s.nodes.v[a][i] = static_cast<float>(v[a]);
    }
  }
  measure_motion(s);
  const FrameResult before = tissue.finish();
  const Momentum start = momentum(s);
  const std::vector<BladePath> planes = random_planes(30, 0.012);
  advance_by(tissue, 0, 0, {{}, planes});
  const FrameResult after = tissue.finish();
  const Momentum end = momentum(s);
  EXPECT_LT((end.linear - start.linear).norm(), 1e-5 * start.linear.norm());
  EXPECT_LT((end.angular - start.angular).norm(), 1e-5 * start.angular.norm());
  EXPECT_LT(after.kinetic_energy + after.elastic_energy,
            before.kinetic_energy + before.elastic_energy);
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  int pairs = 0;
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    int size = 0;
    for (const Fragment& f : tissue.fragments()) {
      if (f.id == tissue.fragment_of(p)) size = f.point_count;
    }
    if (size > kDebrisPoints) continue;
    const Points::Site& site = s.points.site[p];
    for (int axis = 0; axis < 3; ++axis) {
      if ((s.points.bonds[p] >> (3 + axis) & 1) == 0) continue;
      const std::int32_t q = s.bodies[0].next_point(site, axis);
      const auto* a = reinterpret_cast<const Point*>(&cloud[p * sizeof(Point)]);
      const auto* b = reinterpret_cast<const Point*>(&cloud[q * sizeof(Point)]);
      EXPECT_NEAR((Vec3(a->x, a->y, a->z) - Vec3(b->x, b->y, b->z)).norm(), 0.0015, 1e-6);
      ++pairs;
    }
  }
  EXPECT_GT(pairs, 20);
}

/// Two halves that a bridge one point thick still joins, and a bridge two points thick, are drawn
/// apart.
TEST(RoughUse, AThreadTearsAndARibbonHolds) {
  MpmTissue tissue(free_box(Vec3(0.024, 0.024, 0.024), 0.003));
  MpmState& s = tissue.state();
  const LatticeBody& body = s.bodies[0];
  std::vector<std::int32_t> changed;
  const auto is_left = [](int y, int z) {
    return (y == 1 && z == 1) || (y == 5 && z >= 5 && z <= 6);
  };
  for (int y = 0; y < 2 * body.ny; ++y) {
    for (int z = 0; z < 2 * body.nz; ++z) {
      if (is_left(y, z)) continue;
      const std::int32_t p = body.point(7, y, z), q = body.point(8, y, z);
      s.points.bonds[p] &= ~(1u << 3);
      s.points.bonds[q] &= ~(1u << 2);
      changed.push_back(p);
      changed.push_back(q);
    }
  }
  std::sort(changed.begin(), changed.end());
  take_apart(s, changed);
  const std::vector<Vec3> home = homes(s);
  const auto draw = [&](double by) {
    for (std::size_t i = 0; i < home.size(); ++i) {
      const double x = (home[i].x() - 0.012) / 0.003;
      s.nodes.u[0][i] = static_cast<float>(by * std::max(-1.0, std::min(1.0, x)));
    }
    measure_motion(s);
    return tissue.finish().tear_report.bonds_broken;  // since advance()
  };
  EXPECT_EQ(draw(0.0005), 0);
  EXPECT_EQ(draw(0.006), 1);
  EXPECT_EQ(draw(0.006), 1);
}

}  // namespace
}  // namespace tissue_sim
