// What a body's inclusions are, and that each point is treated by its own material.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <utility>
#include <vector>

#include "mpm/state_figures.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/tear_scenes.h"
#include "support/test_scenes.h"

namespace tissue_sim {
namespace {

Inclusion ball(const std::string& material, const Vec3& center, double radius) {
  Inclusion i;
  i.material = material;
  i.region.kind = Region::Kind::kBall;
  i.region.center = center;
  i.region.radius = radius;
  return i;
}

Inclusion below(const std::string& material, double z) {
  Inclusion i;
  i.material = material;
  i.region.z = z;
  return i;
}

TEST(Inclusions, TheLastOneThatHoldsAPointDecides) {
  Scene s = free_box(Vec3(0.02, 0.02, 0.02), 0.002);
  s.bodies[0].material = "liver";
  s.bodies[0].inclusions = {ball("kidney", Vec3::Constant(0.01), 0.006), below("fat", 0.01),
                            ball("liver", Vec3(0.01, 0.01, 0.004), 0.002)};
  Points points;
  const LatticeBody body = make_lattice_bodies(s, points, nullptr)[0];
  ASSERT_EQ(body.materials.size(), 3u) << "liver is named twice, and is one";
  int count[3] = {};
  for (int p = 0; p < points.size(); ++p) {
    const Points::Site& site = points.site[p];
    const Vec3 x = body.site_position(site.x, site.y, site.z);
    const char* expected = (x - Vec3(0.01, 0.01, 0.004)).norm() < 0.002 ? "liver"
                           : x.z() < 0.01                               ? "fat"
                           : (x - Vec3::Constant(0.01)).norm() < 0.006  ? "kidney"
                                                                        : "liver";
    EXPECT_EQ(body.material_of(points, p).name, expected) << x.transpose();
    ++count[points.material_of(p)];
  }
  for (const int of_material : count) EXPECT_GT(of_material, 30);
}

TEST(Inclusions, ThatHoldNothingAreRefused) {
  Scene s = free_box(Vec3(0.02, 0.02, 0.02), 0.002);
  s.bodies[0].inclusions = {below("fat", 0.01), below("skin", -0.01)};
  const auto reason = [&s] { return reason_of([&s] { MpmTissue tissue(s); }); };
  EXPECT_EQ(reason().rfind("inclusions[1] of body 'tissue' holds no point of it", 0), 0u)
      << reason();
  s.bodies[0].inclusions = {below("fat", 0.01), below("skin", 0.012)};
  EXPECT_EQ(reason().rfind("inclusions[0] of body 'tissue' holds no point of it", 0), 0u)
      << reason();
}

TEST(Inclusions, OnlyBlocksOfSeveralMaterialsPay) {
  Scene s = free_box(Vec3(0.02, 0.064, 0.032), 0.002);
  s.bodies[0].inclusions = {below("fat", 0.0079), below("liver", 0.0041)};
  MpmTissue tissue(s);
  int mixed = 0;
  for (const Block* b : tissue.state().blocks.all) {
    mixed += b->material == Block::kMixed;
    EXPECT_EQ(b->mixture.mu.empty(), b->material != Block::kMixed);
    EXPECT_EQ(b->material == Block::kMixed, b->z == 0);
  }
  EXPECT_EQ(mixed, 4);
}

/// A soft block on the ground, held at one end, that a scalpel cuts, a probe presses and its own
/// weight tears.
Scene operation(const std::string& material) {
  Scene s = operation_scene(Vec3(0.08, 0.024, 0.028), Vec3(0, 0, 0.02));
  s.device = Device::kCpu;
  s.materials.resize(2);
  for (Material& m : s.materials) {
    m.young_modulus = 2000;
    m.poisson_ratio = 0.3;
    m.density = 1200;
    m.viscosity = 0.5;
    m.tear_stretch = 1.15;
    m.tear_scatter = 0.1;
    m.friction = 0.6;
  }
  s.materials[0].name = "own";
  s.materials[1].name = "twin";
  s.bodies[0].material = material;
  return s;
}

struct Operated {
  std::vector<std::uint64_t> checksums;
  double energy = 0, push = 0;
  std::int64_t cut = 0, torn = 0;
  std::vector<Vec3> centroids;  ///< of the pieces
};

/// Where the scalpel and the probe are at the end of a frame.
std::vector<Pose> tool_poses(int frame) {
  const Quat down = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const double t = frame / 24.0;
  return {{Vec3(0.002 + 0.01 * t, 0.03 - 0.08 * t, -0.001), down},
          {Vec3(0.03, -0.003, 0.03 - 0.02 * t), down}};
}

Operated operate(const Scene& scene) {
  Simulation simulation(scene);
  Operated r;
  for (int i = 0; i < 24; ++i) {
    const std::vector<Pose> poses = tool_poses(i);
    for (int tool = 0; tool < 2; ++tool) simulation.set_tool(tool, poses[tool]);
    const FrameReport report = simulation.advance_frame();
    EXPECT_FALSE(report.result.blew_up) << i;
    r.checksums.push_back(simulation.tissue().checksum());
    r.energy = report.result.elastic_energy;
    r.push = std::max(r.push, report.result.loads[1].peak_force);
    r.cut += report.result.blade_report.bonds_broken;
    r.torn += report.result.tear_report.bonds_broken;
  }
  return r;
}

/// The same in so many frames of 40 substeps, however much the tissue bears: a rounding error may
/// change that.
Operated operate_in_step(const Scene& scene, int frames) {
  MpmTissue tissue(scene);
  Operated r;
  std::vector<ToolMotion> tools(2);
  for (int i = 0; i < frames; ++i) {
    const std::vector<Pose> poses = tool_poses(i);
    for (int tool = 0; tool < 2; ++tool) {
      tools[tool].begin = i == 0 ? poses[tool] : tools[tool].end;
      tools[tool].end = poses[tool];
      tools[tool].present = true;
    }
    advance_by(tissue, 40, 1.0f / 2400, {tools, {}});
    const FrameResult result = tissue.finish();
    EXPECT_FALSE(result.blew_up) << i;
    r.energy = result.elastic_energy;
    r.push = std::max(r.push, result.loads[1].peak_force);
    r.cut += result.blade_report.bonds_broken;
  }
  for (const Fragment& f : tissue.fragments()) r.centroids.push_back(f.centroid);
  return r;
}

TEST(Inclusions, OneThatFillsItsBodyIsAsTheBodyOfItsMaterial) {
  Scene filled = operation("fat");
  filled.bodies[0].inclusions = {below("own", 1)};
  const Operated own = operate(operation("own")), other = operate(filled);
  EXPECT_GT(own.cut, 10);
  EXPECT_GT(own.torn, 0);
  EXPECT_GT(own.push, 5e-4);
  EXPECT_EQ(other.checksums, own.checksums);
}

TEST(Inclusions, OfAMaterialLikeTheBodysChangeNothingButBits) {
  // Not all the way: through cuts and contact rounding grows, on each processor in its own way, and
  // fast at a cut's front, whose light sides swing freely.
  constexpr int frames = 10;
  {
    Scene mixed = operation("own");
    mixed.materials[0].tear_stretch = mixed.materials[1].tear_stretch = 0;
    Scene plain = mixed;
    mixed.bodies[0].inclusions = {ball("twin", Vec3(0, 0, 0.02), 0.014),
                                  ball("twin", Vec3(0.035, 0, 0.034), 0.01)};
    const Operated a = operate_in_step(plain, frames), b = operate_in_step(mixed, frames);
    EXPECT_GT(a.cut, 10);
    EXPECT_EQ(a.cut, b.cut);
    EXPECT_GT(a.push, 5e-4);
    EXPECT_NEAR(b.energy, a.energy, 1e-3 * a.energy);
    EXPECT_NEAR(b.push, a.push, 1e-3 * a.push);
    ASSERT_EQ(a.centroids.size(), b.centroids.size());
    for (std::size_t i = 0; i < a.centroids.size(); ++i) {
      EXPECT_LT((a.centroids[i] - b.centroids[i]).norm(), 1e-6);
    }
  }
}

TEST(Inclusions, GiveTheSameBitsForAnyNumberOfThreads) {
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 4);
  Scene s = operation("own");
  s.materials[1].law = Law::kNeoHookean;
  s.materials[1].young_modulus = 6000;
  s.bodies[0].inclusions = {ball("twin", Vec3(0, 0, 0.02), 0.014),
                            ball("fat", Vec3(0.035, 0, 0.034), 0.01)};
  const Operated first = operate(s);
  EXPECT_GT(first.torn, 0);
  for (const int threads : {2, 3}) {
    s.threads = threads;
    EXPECT_EQ(operate(s).checksums, first.checksums) << threads;
  }
}

TEST(Inclusions, EachMaterialBoundsTheSubstepByWhatItsPointsStiffenedBy) {
  Scene s = free_box(Vec3(0.016, 0.016, 0.016), 0.002);
  s.bodies[0].material = "fat";
  s.bodies[0].inclusions = {below("skin", 0.008)};
  for (const char* name : {"fat", "skin"}) {
    s.materials.push_back(find_material(s, name));
    s.materials.back().viscosity = 0;  // which shortens substeps, too
  }
  MpmTissue tissue(s);
  const MpmState& state = tissue.state();
  const Material skin = find_material(s, "skin"), fat = find_material(s, "fat");
  EXPECT_NEAR(tissue.stable_substep(), 0.5 * 0.002 / wave_speed(skin), 1e-9);
  EXPECT_NEAR(stable_substep(state, {{3, 1}}), 0.5 * 0.002 / wave_speed(skin), 1e-9)
      << "fat may stiffen a lot";
  EXPECT_LT(stable_substep(state, {{1, 3}}), 0.7 * 0.5 * 0.002 / wave_speed(skin));
  // What is measured: the upper half squeezed to two thirds.
  Nodes& n = tissue.state().nodes;
  const LatticeBody& b = state.bodies[0];
  b.for_each_node([&](int i, int x, int, int cell_z) {
    const double z = (cell_z + 0.5) * 0.002;
    n.u[2][i] = static_cast<float>(-0.3 * std::max(0.0, z - 0.012));
    n.u[0][i] = static_cast<float>(0.6 * (x + 1) * 0.002 * (z > 0.012 ? 1 : 0));
  });
  const float before = tissue.stable_substep();
  tissue.finish();
  EXPECT_EQ(tissue.stable_substep(), before);
}

TEST(Inclusions, TissueTearsWhereItsMaterialIsTheWeaker) {
  for (const double right_limit : {1.5, 0.0}) {  // tears later, never
    StripOf of;
    of.limit = 1.3;
    of.right_limit = right_limit;
    Strip<MpmTissue> strip(of);
    const double largest = strip.pull_apart(1.28, 0.3);
    EXPECT_NEAR(largest / strip.force_at(1.3), 1, 0.02);
    const MpmState& s = strip.tissue().state();
    int torn = 0;
    for (int p = 0; p < s.points.size(); ++p) {
      const Points::Site& site = s.points.site[p];
      if (s.points.bonds[p] == whole_bonds(s.bodies[0], site)) continue;
      ++torn;
      EXPECT_LT(s.bodies[0].site_position(site.x, site.y, site.z).x(), 0.0241);
    }
    EXPECT_GT(torn, 50);
    EXPECT_EQ(strip.tissue().fragments().size(), 2u);
  }
}

}  // namespace
}  // namespace tissue_sim
