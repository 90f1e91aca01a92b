// Tools and the ground at the true surface, on the GPU: the stiff springs and their added masses.
// Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cmath>
#include <cstdio>
#include <map>

#include "contact/surface_spring.h"
#include "mpm/cuda/parts_on_device.h"
#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/momentum.h"
#include "tissue/saved_states.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.0025;
const Vec3 kSize(0.0225, 0.02, 0.0125);

Material soft_material() {
  Material m;
  m.name = "phantom";
  m.law = Law::kNeoHookean;
  m.young_modulus = 5000;
  m.poisson_ratio = 0.45;
  m.density = 1000;
  return m;
}

/// A block in free space and a ball.
Scene block_and_ball() {
  Scene s = free_box(kSize, kCell);
  s.device = Device::kCuda;
  s.materials = {soft_material()};
  s.bodies[0].material = "phantom";
  Tool ball;
  ball.name = "ball";
  ball.type = ToolType::kBall;
  ball.radius = 0.006;
  ball.friction = 0;
  s.tools = {ball};
  return s;
}

Pose pointing_down(const Vec3& tip) { return {tip, Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()))}; }

double weight_at(double place, int d) {
  if (d == 1) return 0.75 - place * place;
  const double side = d == 0 ? 0.5 - place : 0.5 + place;
  return 0.5 * side * side;
}

/// What colliders do in a substep, in double precision and with matrices of all nodes.
struct BruteForce {
  std::map<int, double> begun;  ///< how deep contact of a point with the tool began
  int touching = 0, began = 0;

  /// Velocities after a substep of `dt` that follows one of `before`, of tissue without friction
  /// and drag, and the impulse on the tool.
  std::vector<Vec3> step(const MpmState& s, const OuterPoints& places, const Collider& tool,
                         double before, double dt, Vec3& on_tool) {
    const LatticeBody& body = s.bodies[0];
    std::map<std::array<int, 3>, int> node_at;
    body.for_each_node([&](int node, int x, int y, int z) { node_at[{x, y, z}] = node; });
    const reference::Step free = reference::substep(s, dt);
    const std::size_t n = s.nodes.size();
    const double kick = before > 0 && before != dt ? 0.5 * (before + dt) : dt;
    const double grown = before > 0 ? std::max(0.0, 1 - before * before / (dt * dt)) : 0;
    std::vector<Vec3> v(n), impulse(n, Vec3::Zero());
    std::vector<Eigen::Matrix3d> B(n, Eigen::Matrix3d::Zero());
    for (std::size_t i = 0; i < n; ++i) {
      v[i] = Vec3(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    }
    const Material& m = body.materials[0];
    const auto modulus = static_cast<float>(lame_lambda(m) + 2 * lame_mu(m));
    std::map<int, double> still;
    touching = began = 0;
    on_tool = Vec3::Zero();
    for (int p = 0; p < s.points.size(); ++p) {
      const CudaOuterPlace outer = places.of(s, p);
      const float4& at = outer.place;
      const Points::Site& site = s.points.site[p];
      const Vec3 own(site.x & 1 ? 0.25 : -0.25, site.y & 1 ? 0.25 : -0.25,
                     site.z & 1 ? 0.25 : -0.25);
      const bool stiff = at.w != 0;
      const Vec3 place = stiff ? Vec3(at.x, at.y, at.z) : own;
      Vec3 x = body.node_position(site.x / 2, site.y / 2, site.z / 2) + kCell * place;
      Vec3 moves = Vec3::Zero();
      int node[27];
      double weight[27], size = 0;
      for (int k = 0; k < 27; ++k) {
        const int d[3] = {k % 3, k / 3 % 3, k / 9};
        weight[k] =
            weight_at(place[0], d[0]) * weight_at(place[1], d[1]) * weight_at(place[2], d[2]);
        size += std::fabs(weight[k]);
        node[k] = node_at.at({site.x / 2 + d[0] - 1, site.y / 2 + d[1] - 1, site.z / 2 + d[2] - 1});
        x += weight[k] * free_u(s, node[k]);
        moves += weight[k] * v[node[k]];
      }
      const float xf[3] = {float(x[0]), float(x[1]), float(x[2])};
      const Gap g = gap(tool, xf);
      if (g.distance >= 0) continue;
      EXPECT_TRUE(stiff) << "points within the body are deeper than the ball";
      ++touching;
      const bool begins = begun.count(p) == 0;
      if (begins) ++began;
      const double deep = -static_cast<double>(g.distance);
      const double start =
          std::min(kBegunStays * (begins ? (1 - 1 / double(kAcross)) * deep : begun[p]), deep);
      still[p] = start;
      const double k_across = double(kAcross) * modulus * outer.area / kCell;
      const Vec3 normal(g.normal[0], g.normal[1], g.normal[2]);
      float vc[3];
      velocity_at(tool, xf, vc);
      const Vec3 of_tool(vc[0], vc[1], vc[2]);
      const double push =
          std::max(0.0, k_across * (deep - start) -
                            kDampingAcross * dt * k_across * normal.dot(moves - of_tool));
      const double b = kInertia * k_across * dt * dt;
      for (int k = 0; k < 27; ++k) {
        const Eigen::Matrix3d own_b = b * std::fabs(weight[k]) * size * normal * normal.transpose();
        B[node[k]] += own_b;
        impulse[node[k]] += kick * weight[k] * push * normal -
                            (begins ? 1 : grown) * own_b * (v[node[k]] - of_tool);
      }
    }
    begun = still;
    for (std::size_t i = 0; i < n; ++i) {
      if (s.nodes.inv_mass[i] == 0) continue;
      const Vec3 others = kick * (free.force[i] + free.mass[i] * s.scene.gravity);
      const Eigen::Matrix3d M = free.mass[i] * Eigen::Matrix3d::Identity() + B[i];
      const Vec3 change = M.ldlt().solve(others + impulse[i]);
      on_tool -= free.mass[i] * change - others;
      v[i] += change;
    }
    return v;
  }
  static Vec3 free_u(const MpmState& s, int i) {
    return Vec3(s.nodes.u[0][i], s.nodes.u[1][i], s.nodes.u[2][i]);
  }
};

class SurfaceContactOnGpu : public OnEitherDevice<CudaMpmTissue> {
 protected:
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
  /// Substeps while a ball presses faster and faster, the last ones longer than those before.
  static void agrees(const char* shape) {
    if (shape != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", shape, 1);
    Scene scene = block_and_ball();
    scene.gravity = Vec3(0.3, -0.2, -9.81);
    CudaMpmTissue tissue(scene);
    MpmState& s = tissue.state();
    const std::vector<Vec3> home = homes(s);
    for (std::size_t i = 0; i < home.size(); ++i) {
      const Vec3 x = home[i] - 0.5 * kSize;
      const Vec3 u(0.02 * x.x() + 0.03 * x.y(), -0.03 * x.y(), 0.02 * x.z() + 0.01 * x.x());
      const Vec3 v = Vec3(0.02, -0.03, 0.1) + Vec3(2, 1, -3).cross(x) + 20 * x.x() * Vec3(0, 0, 1);
      for (int c = 0; c < 3; ++c) {
        s.nodes.u[c][i] = static_cast<float>(u[c]);
        s.nodes.v[c][i] = static_cast<float>(v[c]);
      }
    }
    tissue.push();
    std::printf("%s\n", tissue.plan().c_str());
    const OuterPoints places(s, s.anchors);
    BruteForce expected;
    Vec3 tip(0.011, 0.0093, kSize.z() - 0.0006);
    double before = 0;
    for (int i = 0; i < 6; ++i) {
      const double dt = i < 4 ? 1e-4 : 1.3e-4;
      ToolMotion motion;
      motion.present = true;
      motion.begin = pointing_down(tip);
      tip += dt * Vec3(0.05, -0.02, -0.2 - 0.15 * i);
      motion.end = pointing_down(tip);
      const FrameInput input{{&motion, 1}, {}};
      const Collider tool = FrameColliders(s.scene, input, static_cast<float>(dt)).at_end()[1];
      tissue.pull();
      Vec3 on_tool;
      const std::vector<Vec3> v = expected.step(s, places, tool, before, dt, on_tool);
      ASSERT_GT(expected.touching, 4);
      ASSERT_EQ(expected.began == expected.touching, i == 0);
      std::vector<Vec3> was(v.size());
      double scale = 0;
      for (std::size_t k = 0; k < v.size(); ++k) {
        was[k] = Vec3(s.nodes.v[0][k], s.nodes.v[1][k], s.nodes.v[2][k]);
        scale = std::max(scale, (v[k] - was[k]).norm());
      }
      advance_by(tissue, 1, static_cast<float>(dt), input);
      const ToolLoad load = tissue.finish().loads[0];
      tissue.pull();
      double worst = 0;
      for (std::size_t k = 0; k < v.size(); ++k) {
        if (s.nodes.inv_mass[k] == 0) continue;
        const Vec3 got(s.nodes.v[0][k], s.nodes.v[1][k], s.nodes.v[2][k]);
        worst = std::max(worst, (got - v[k]).norm());
      }
      const double of_load = (dt * load.mean.force - on_tool).norm();
      std::printf("substep %d: %d touch, %d began, off by %.2e of %.2e m/s, load by %.2e of %.2e\n",
                  i, expected.touching, expected.began, worst, scale, of_load, on_tool.norm());
      EXPECT_LT(worst, 3e-4 * scale) << i;
      EXPECT_LT(of_load, 3e-4 * on_tool.norm()) << i;
      before = dt;
    }
  }
};

TEST_F(SurfaceContactOnGpu, SubstepsAgreeWithBruteForce) { agrees(nullptr); }
TEST_F(SurfaceContactOnGpu, SubstepsAgreeInBundles) { agrees("8 2 1 256 1"); }
TEST_F(SurfaceContactOnGpu, SubstepsAgreeWhereBlocksWait) { agrees("2 2 3 192 0"); }

// What it loses the tool got: while the added masses take in and resist, in the middle of a blow.
TEST_F(SurfaceContactOnGpu, AToolFeelsTheOppositeOfWhatItGives) {
  for (const double friction : {0.0, 0.6}) {
    Scene scene = block_and_ball();
    scene.tools[0].friction = friction;
    CudaMpmTissue tissue(scene);
    const std::vector<Vec3> home = homes(tissue.state());
    ToolMotion motion;
    motion.present = true;
    Vec3 tip(0.009, 0.012, kSize.z() + 0.0005);
    motion.begin = motion.end = pointing_down(tip);
    Vec3 impulse = Vec3::Zero(), moment = Vec3::Zero();
    for (int f = 0; f < 12; ++f) {
      const Vec3 by = kFrame * Vec3(0.02, -0.01, f < 6 ? -0.06 : 0.12);
      motion.begin.position = motion.end.position;
      motion.end.position += by;
      const int n = static_cast<int>(std::ceil(kFrame / tissue.stable_substep()));
      advance_by(tissue, n, static_cast<float>(kFrame / n), {{&motion, 1}, {}});
      const ToolLoad load = tissue.finish().loads[0];
      impulse += kFrame * load.mean.force;
      // A frame's moment is about the tip where it was at each time: in the mean halfway.
      moment +=
          kFrame * (load.mean.torque + (motion.end.position - 0.5 * by).cross(load.mean.force));
    }
    tissue.pull();
    const Nodes& n = tissue.state().nodes;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    for (std::size_t i = 0; i < n.size(); ++i) {
      const Vec3 at = home[i] + Vec3(n.u[0][i], n.u[1][i], n.u[2][i]);
      const Vec3 p = double(n.mass[i]) * Vec3(n.v[0][i], n.v[1][i], n.v[2][i]);
      linear += p;
      angular += at.cross(p);
    }
    std::printf("friction %g: impulse off by %.2e of %.2e, moment by %.2e of %.2e\n", friction,
                (impulse + linear).norm(), linear.norm(), (moment + angular).norm(),
                angular.norm());
    EXPECT_GT(linear.norm(), 1e-5);
    EXPECT_LT((impulse + linear).norm(), 5e-4 * linear.norm());
    EXPECT_LT((moment + angular).norm(), 2e-2 * angular.norm());
  }
}

// A block that falls on the ground has no more energy after a bounce than before, comes to rest,
// and then its surface lies on the ground to some hundredths of a cell.
TEST_F(SurfaceContactOnGpu, AFallingBlockGainsNoEnergyAndComesToRest) {
  Scene scene = free_box(Vec3(0.02, 0.02, 0.015), kCell);
  scene.device = Device::kCuda;
  scene.materials = {soft_material()};
  scene.bodies[0].material = "phantom";
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  constexpr double kDrop = 0.01;
  scene.bodies[0].pose.position = Vec3(0, 0, 0.0075 + kDrop);
  Simulation simulation(scene);
  auto& tissue = dynamic_cast<MpmTissue&>(simulation.tissue());
  const std::vector<Vec3> home = homes(tissue.state());
  const auto height_and_speed = [&] {
    pull(on_gpu(tissue));
    const Nodes& n = tissue.state().nodes;
    double mass = 0, height = 0, speed = 0;
    for (std::size_t i = 0; i < n.size(); ++i) {
      mass += n.mass[i];
      height += n.mass[i] * (home[i].z() + n.u[2][i]);
      speed += n.mass[i] * n.v[2][i];
    }
    return std::make_pair(height / mass, speed / mass);
  };
  // The energy is that of the nodes, which has not what springs and added masses hold: so where the
  // block is highest.
  constexpr double kGravity = 9.81, kMass = 1000 * 0.02 * 0.02 * 0.015;
  std::vector<double> peaks = {height_and_speed().first}, energy = {kMass * kGravity * kDrop};
  double last_speed = -1;
  for (int frame = 0; frame < 120; ++frame) {
    const FrameResult result = simulation.advance_frame().result;
    ASSERT_FALSE(result.blew_up) << frame;
    const auto [height, speed] = height_and_speed();
    if (last_speed > 0 && speed <= 0) {
      peaks.push_back(height);
      energy.push_back(result.kinetic_energy + result.elastic_energy +
                       kMass * kGravity * (height - 0.0075));
    }
    last_speed = speed;
  }
  std::printf("highest, energy:");
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    std::printf(" %.3f mm %.3f", 1e3 * peaks[i], energy[i] / energy[0]);
  }
  std::printf(", speed at the end %.2e m/s\n", last_speed);
  ASSERT_GT(peaks.size(), 1u);
  for (std::size_t i = 1; i < peaks.size(); ++i) {
    EXPECT_LT(peaks[i], peaks[0]) << i;
    EXPECT_LT(energy[i], energy[i - 1] + 0.01 * energy[0]) << i;
  }
  const SettleReport report = simulation.settle({1e-4, 3, 30});
  EXPECT_TRUE(report.at_rest) << report.speed;
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  const auto* points = reinterpret_cast<const Point*>(cloud.data());
  double lowest = 1;
  for (int i = 0; i < count; ++i) lowest = std::min<double>(lowest, points[i].z);
  std::printf("the lowest points lie %.4f cells above the ground\n", lowest / kCell);
  // A quarter of a cell above their surface, less what the weight squeezes and the spring hides.
  EXPECT_GT(lowest, (0.25 - 0.03) * kCell);
  EXPECT_LT(lowest, (0.25 + 0.01) * kCell);
}

// Its flats push what has no cut yet as softly: at the surface they would drag along what they are
// about to cut.
TEST_F(SurfaceContactOnGpu, TheFlatOfABladePressesAsOnTheCpu) {
  Scene scene = free_box(kSize, kCell);
  Material material = soft_material();
  material.viscosity = 5;
  scene.materials = {material};
  scene.bodies[0].material = "phantom";
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, 0.006, -1);
  held.max = Vec3(1, 1, 1);
  scene.bodies[0].anchors = {held};
  Tool blade;
  blade.name = "blade";
  blade.type = ToolType::kScalpel;
  blade.blade_length = 0.02;
  blade.blade_width = 0.03;
  blade.blade_thickness = 0.004;
  scene.tools = {blade};
  double force[2], energy[2];
  for (const Device device : {Device::kCpu, Device::kCuda}) {
    const int which = device == Device::kCuda;
    scene.device = device;
    Simulation simulation(scene);
    for (int frame = 0; frame < 40; ++frame) {
      const double y = -0.0021 + 0.002 * std::min(1.0, frame / 20.0);  // its edge stays outside
      simulation.set_tool(0, {Vec3(kSize.x() + 0.003, y, kSize.z() + 0.003), Quat::Identity()});
      const FrameResult result = simulation.advance_frame().result;
      force[which] = result.loads[0].mean.force.y();
      energy[which] = result.elastic_energy;
    }
    EXPECT_EQ(simulation.tissue().fragments().size(), 1u);
  }
  std::printf("%.6f and %.6f N, %.4e and %.4e J\n", force[0], force[1], energy[0], energy[1]);
  EXPECT_LT(force[0], -0.5);
  EXPECT_NEAR(force[1], force[0], 1e-3 * std::fabs(force[0]));
  EXPECT_NEAR(energy[1], energy[0], 2e-3 * energy[0]);
}

TEST_F(SurfaceContactOnGpu, SameBitsRunAfterRunAndFromASavedState) {
  SavedRun run;
  run.scene = block_and_ball();
  run.scene.gravity = Vec3(0, 0, -9.81);
  run.scene.ground.enabled = true;
  run.scene.tools[0].friction = 0.5;
  run.frames = 12;
  run.every = 2;
  run.inputs = [](Simulation& simulation, std::int64_t frame) {
    const double t = static_cast<double>(frame) / 12;
    simulation.set_tool(
        0, pointing_down(Vec3(0.009 + 0.004 * t, 0.011, kSize.z() + 0.001 - 0.004 * t)));
  };
  go_on_from_states(run);
}

}  // namespace
}  // namespace tissue_sim
#endif
