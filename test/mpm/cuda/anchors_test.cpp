// Anchors that hold tissue at their faces: the GPU against the CPU. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cstdlib>
#include <cstring>
#include <random>

#include "mpm/mpm_tissue.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

using Random = std::mt19937;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
Vec3 between(Random& random, const Vec3& low, const Vec3& high) {
  return {between(random, low[0], high[0]), between(random, low[1], high[1]),
          between(random, low[2], high[2])};
}

const Vec3 kSize(0.024, 0.02, 0.016);

/// A box from the origin, held by a plane, a ball and a box anywhere.
Scene held_anywhere(Random& random) {
  Scene scene = inviscid(free_box(kSize, 0.0021));
  scene.gravity = Vec3(1, 2, -9.81);
  std::vector<Anchor>& anchors = scene.bodies[0].anchors;
  Region plane;
  plane.z = between(random, 0.001, 0.005);
  anchors.emplace_back(plane);
  Region ball;
  ball.kind = Region::Kind::kBall;
  ball.center = between(random, Vec3(0, 0, 0.01), kSize);
  ball.radius = between(random, 0.003, 0.006);
  anchors.emplace_back(ball);
  Region box;
  box.kind = Region::Kind::kBox;
  box.min = between(random, Vec3(-0.002, -0.002, -0.002), 0.6 * kSize);
  box.max = box.min + between(random, Vec3(0.004, 0.004, 0.004), 0.6 * kSize);
  anchors.emplace_back(box);
  return scene;
}

/// Moves each node by a strain of some 0.2 and a bit of chance, told by its place.
template <class T>
void deform_and_shake(T& tissue, unsigned seed) {
  pull(tissue);
  MpmState& s = tissue.state();
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int x, int y, int z) {
      if (s.nodes.inv_mass[node] == 0) return;
      const Vec3 at = b.node_position(x, y, z);
      Random random(seed + 7919u * static_cast<unsigned>(x + 100 * (y + 100 * z)));
      const Vec3 u = 0.15 * at.cwiseProduct(Vec3(1, -0.5, 0.7)) +
                     0.1 * Vec3(at.z(), at.x(), -at.y()) +
                     between(random, Vec3::Constant(-1e-4), Vec3::Constant(1e-4));
      const Vec3 v = between(random, Vec3::Constant(-0.05), Vec3::Constant(0.05));
      for (int a = 0; a < 3; ++a) {
        s.nodes.u[a][node] = static_cast<float>(u[a]);
        s.nodes.v[a][node] = static_cast<float>(v[a]);
      }
    });
  }
  push(tissue);
  s.faces.until_search = 1e9;
}

struct Outcome {
  std::vector<float> places;   ///< [points][6]: displacement, velocity
  std::vector<float> outside;  ///< share of each point that is not held
  std::vector<Wrench> loads;
  std::uint64_t checksum = 0;
};

template <class T>
Outcome outcome_of(T& tissue, const FrameResult& result) {
  Outcome o;
  EXPECT_FALSE(result.blew_up);
  PointSelection selection;
  selection.fields = kDisplacement | kVelocity;
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points(selection, cloud);
  o.places.resize(6 * count);
  for (int i = 0; i < count; ++i) {
    std::memcpy(&o.places[6 * i], &cloud[selection.point_size() * i + sizeof(Point)],
                6 * sizeof(float));
  }
  const Points& points = tissue.state().points;
  for (int p = 0; p < points.size(); ++p) {
    o.outside.push_back(points.free_volume_of(p) / points.volume[p]);
  }
  o.loads = result.anchor_loads;
  o.checksum = tissue.checksum();
  return o;
}

/// Places [m], velocities [m/s] and loads [N] that are apart. A point that is nearly all held
/// counts for as little as it weighs.
void expect_same(const Outcome& cpu, const Outcome& gpu, double place, double velocity,
                 double force) {
  ASSERT_EQ(cpu.places.size(), gpu.places.size());
  double worst_place = 0, worst_velocity = 0, worst_force = 0, moved = 0, largest = 0;
  for (std::size_t i = 0; i < cpu.places.size(); ++i) {
    ASSERT_EQ(cpu.outside[i / 6], gpu.outside[i / 6]);
    const double apart =
        std::min(1.0f, cpu.outside[i / 6]) * std::fabs(cpu.places[i] - gpu.places[i]);
    double& worst = i % 6 < 3 ? worst_place : worst_velocity;
    if (!(apart <= worst)) worst = apart;
    if (i % 6 >= 3) moved = std::max(moved, std::fabs(static_cast<double>(cpu.places[i])));
  }
  ASSERT_EQ(cpu.loads.size(), gpu.loads.size());
  for (std::size_t i = 0; i < cpu.loads.size(); ++i) {
    largest = std::max(largest, cpu.loads[i].force.norm());
    worst_force = std::max(worst_force, (cpu.loads[i].force - gpu.loads[i].force).norm());
    EXPECT_LT((cpu.loads[i].torque - gpu.loads[i].torque).norm(), 0.05 * force) << i;
  }
  std::printf("apart by %.1e m, %.1e of %.1e m/s, %.1e of %.1e N\n", worst_place, worst_velocity,
              moved, worst_force, largest);
  EXPECT_LT(worst_place, place);
  EXPECT_LT(worst_velocity, velocity);
  EXPECT_LT(worst_force, force);
  EXPECT_GT(moved, 10 * velocity);
  EXPECT_GT(largest, 10 * force);
}

class AnchorsOnGpu : public OnEitherDevice<CudaMpmTissue>,
                     public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    OnEitherDevice<CudaMpmTissue>::SetUp();
    if (GetParam() != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", GetParam(), 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};
// By default; several waves; a thread a column; several blocks to a thread block; large ones.
INSTANTIATE_TEST_SUITE_P(Shapes, AnchorsOnGpu,
                         testing::Values(nullptr, "4 4 4 32 0", "8 8 2 64 1", "2 2 3 192 0",
                                         "16 16 8 256 0"));

TEST_P(AnchorsOnGpu, HoldFacesAsOnTheCpu) {
  Random random(1);
  for (int trial = 0; trial < 6; ++trial) {
    const Scene scene = held_anywhere(random);
    const auto run = [&](auto tissue) {
      deform_and_shake(tissue, trial);
      advance_by(tissue, 1, 5e-5f, {});
      return outcome_of(tissue, tissue.finish());
    };
    SCOPED_TRACE(trial);
    expect_same(run(MpmTissue(scene)), run(CudaMpmTissue(scene)), 1e-7, 1e-3, 1e-3);
  }
}

TEST_P(AnchorsOnGpu, MoveAsOnTheCpu) {
  Random random(2);
  for (int trial = 0; trial < 3; ++trial) {
    const Scene scene = held_anywhere(random);
    std::vector<AnchorMotion> motion;
    for (const Anchor& a : scene.bodies[0].anchors) {
      AnchorMotion m;
      m.begin.position = a.origin();
      m.end = {a.origin() + between(random, Vec3::Constant(-2e-4), Vec3::Constant(2e-4)),
               Quat(Eigen::AngleAxisd(0.02, Vec3(1, trial, 2).normalized()))};
      motion.push_back(m);
    }
    FrameInput input;
    input.anchors = motion;
    const auto run = [&](auto tissue) {
      advance_by(tissue, 40, 5e-5f, input);
      return outcome_of(tissue, tissue.finish());
    };
    SCOPED_TRACE(trial);
    const Outcome cpu = run(MpmTissue(scene)), gpu = run(CudaMpmTissue(scene));
    expect_same(cpu, gpu, 1e-7, 1e-3, 1e-3);
    EXPECT_EQ(gpu.checksum, run(CudaMpmTissue(scene)).checksum) << "not the same bits again";
  }
}

TEST_P(AnchorsOnGpu, HoldWhatIsCutAsOnTheCpu) {
  Random random(3);
  const Scene scene = held_anywhere(random);
  const BladePath path = plane_cut(0.5 * kSize, Vec3(1, 0.3, 0.2));
  const auto run = [&](auto tissue) {
    cut_now(tissue, path);
    advance_by(tissue, 100, 5e-5f, {});
    return outcome_of(tissue, tissue.finish());
  };
  expect_same(run(MpmTissue(scene)), run(CudaMpmTissue(scene)), 1e-7, 1e-3, 1e-3);
}

TEST_P(AnchorsOnGpu, BearTheSubstepThatTheCpuFinds) {
  Random random(4);
  for (int trial = 0; trial < 3; ++trial) {
    const Scene scene = held_anywhere(random);
    MpmTissue cpu(scene);
    CudaMpmTissue gpu(scene);
    const float there = gpu.substep_for({});
    EXPECT_NEAR(there, cpu.substep_for({}), 0.05 * there) << trial;
  }
}

}  // namespace
}  // namespace tissue_sim
#endif
