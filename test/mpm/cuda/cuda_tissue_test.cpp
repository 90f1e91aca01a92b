// The GPU against brute force, against the CPU and against itself. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "compute/device_array.h"
#include "mpm/mpm_tissue.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

class OnGpu : public OnEitherDevice<CudaMpmTissue> {};

/// With blocks of the shape that the parameter names, null for the default.
class OnGpuInBlocks : public OnGpu, public testing::WithParamInterface<const char*> {
 protected:
  void SetUp() override {
    OnGpu::SetUp();
    if (GetParam() != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", GetParam(), 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};
INSTANTIATE_TEST_SUITE_P(Shapes, OnGpuInBlocks,
                         testing::Values(nullptr, "6 5 4 64 0", "6 5 8 32 0",
                                         "10 4 2 256 1"));  // five of eight warps push

/// A block on the ground, cut by a scalpel and pushed by a probe for a second.
struct Operation {
  Scene scene;
  std::vector<ToolMotion> tools;

  Operation() {
    scene = inviscid(free_box(Vec3(0.06, 0.04, 0.024), 0.002));
    scene.gravity = Vec3(0, 0, -9.81);
    scene.ground.enabled = true;
    scene.damping = 5;
    Region held;
    held.kind = Region::Kind::kBox;
    held.min = Vec3(-0.01, -0.01, -0.01);
    held.max = Vec3(0.012, 0.1, 0.1);
    scene.bodies[0].anchors.push_back(held);
    scene.tools.resize(2);
    scene.tools[0].name = "scalpel";
    scene.tools[0].type = ToolType::kScalpel;
    scene.tools[0].blade_length = 0.03;
    scene.tools[1].name = "probe";
    tools.resize(2);
  }
  /// Poses over frame i of 60: the scalpel goes through at x = 0.03, the probe presses from above.
  const std::vector<ToolMotion>& frame(int i) {
    const auto pose = [](int tool, double t) {
      Pose p;
      // The blade's edge looks along +x of its frame: turned to +y; its tip below the tissue.
      const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
      if (tool == 0) {
        const Quat edge(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()));
        p.orientation = (edge * down).normalized();
        p.position = Vec3(0.031, -0.012 + 0.07 * t, -0.001);
      } else {
        p.orientation = down;
        p.position = Vec3(0.05, 0.02, 0.0275 - 0.012 * t);
      }
      return p;
    };
    for (int k = 0; k < 2; ++k) {
      tools[k].present = true;
      tools[k].begin = pose(k, i / 60.0);
      tools[k].end = pose(k, (i + 1) / 60.0);
    }
    return tools;
  }
};

struct Outcome {
  std::vector<Point> points;
  std::vector<int> pieces;
  std::vector<ToolLoad> loads;
  std::vector<std::uint64_t> checksums;
  std::int64_t bonds_broken = 0;
  double kinetic = 0, elastic = 0;
};

template <class T>
Outcome operate(T& tissue, Operation& operation, int frames) {
  Outcome o;
  for (int i = 0; i < frames; ++i) {
    const int substeps = 220;
    advance_by(tissue, substeps, static_cast<float>(1.0 / 60 / substeps), {operation.frame(i), {}});
    const FrameResult r = tissue.finish();
    EXPECT_FALSE(r.blew_up) << "in frame " << i;
    EXPECT_LT(1.0 / 60 / substeps, tissue.stable_substep()) << "in frame " << i;
    o.loads.insert(o.loads.end(), r.loads.begin(), r.loads.end());
    o.bonds_broken += r.blade_report.bonds_broken;
    o.kinetic = r.kinetic_energy;
    o.elastic = r.elastic_energy;
    o.checksums.push_back(tissue.checksum());
    if (r.blew_up) break;
  }
  std::vector<std::uint8_t> cloud;
  o.points.resize(tissue.read_points({}, cloud));
  std::memcpy(o.points.data(), cloud.data(), cloud.size());
  o.pieces = piece_sizes(tissue);
  return o;
}

TEST_P(OnGpuInBlocks, ASecondOfCuttingAgreesWithTheCpu) {
  Operation operation;
  MpmTissue cpu(operation.scene);
  CudaMpmTissue gpu(operation.scene);
  const Outcome a = operate(cpu, operation, 60), b = operate(gpu, operation, 60);
  EXPECT_GT(a.pieces.size(), 1u) << "the cut must go through";
  EXPECT_EQ(a.pieces, b.pieces);
  EXPECT_EQ(a.bonds_broken, b.bonds_broken);
  ASSERT_EQ(a.points.size(), b.points.size());
  double worst = 0, sum = 0, peak = 0, worst_force = 0;
  int other_piece = 0;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const Point &p = a.points[i], &q = b.points[i];
    ASSERT_EQ(p.id, q.id);
    other_piece += p.fragment != q.fragment;
    const double d = Vec3(p.x - q.x, p.y - q.y, p.z - q.z).norm();
    worst = std::max(worst, d);
    sum += d;
  }
  for (std::size_t i = 0; i < a.loads.size(); ++i) {
    peak = std::max(peak, a.loads[i].mean.force.norm());
    worst_force = std::max(worst_force, (a.loads[i].mean.force - b.loads[i].mean.force).norm());
  }
  std::printf(
      "CPU and GPU after a second: points apart by %.2e m at most, %.2e m in the mean; "
      "forces by %.2e N of %.2e N\n",
      worst, sum / a.points.size(), worst_force, peak);
  EXPECT_EQ(other_piece, 0);
  EXPECT_GT(peak, 0.01) << "the probe must press";
  // A twentieth of a cell; friction and contact make small differences grow.
  EXPECT_LT(worst, 1e-4);
  EXPECT_LT(worst_force, 0.02 * peak);
  EXPECT_NEAR(a.elastic, b.elastic, 0.01 * a.elastic);
}

/// Says the memory that the scene takes after some substeps, where half of it is free.
void says_what_it_needs(const Scene& scene, int substeps) {
  double megabytes = 0;
  {
    CudaMpmTissue tissue(scene);
    if (substeps > 0) advance_by(tissue, substeps, 1e-5f, {});
    tissue.finish();
    megabytes = std::ldexp(static_cast<double>(tissue.device_bytes()), -20);
  }
  DeviceArray<char> taken;
  std::size_t free = 0, total = 0;
  ASSERT_EQ(cudaMemGetInfo(&free, &total), cudaSuccess);
  taken.resize(free - (static_cast<std::size_t>(0.5 * megabytes) << 20));
  try {
    const CudaMpmTissue tissue(scene);
    FAIL() << "half of the memory that it needs was there";
  } catch (const std::runtime_error& e) {
    double needs = 0, left = 0, of = 0;
    ASSERT_EQ(std::sscanf(e.what(),
                          "the GPU's memory does not suffice: the scene needs %lf MB, %lf MB of "
                          "%lf MB are free",
                          &needs, &left, &of),
              3)
        << e.what();
    EXPECT_NEAR(needs, megabytes, 0.05 * megabytes) << e.what();
    EXPECT_LT(left, needs) << e.what();
    EXPECT_NEAR(of, std::ldexp(static_cast<double>(total), -20), 1) << e.what();
    std::printf("%s\n", e.what());
  }
}

TEST_F(OnGpu, SaysHowMuchMemoryASceneNeeds) {
  says_what_it_needs(free_box(Vec3(0.08, 0.08, 0.08), 0.001), 0);
}

TEST_F(OnGpu, SaysHowMuchMemoryASceneOnTheGroundNeeds) {
  Scene scene = free_box(Vec3(0.08, 0.08, 0.08), 0.001);
  scene.ground.enabled = true;
  says_what_it_needs(scene, 1);  // which come to contact
}

TEST_P(OnGpuInBlocks, SameBitsRunAfterRun) {
  Operation operation;
  CudaMpmTissue first(operation.scene), second(operation.scene);
  const Outcome a = operate(first, operation, 45), b = operate(second, operation, 45);
  EXPECT_EQ(a.checksums, b.checksums);
  EXPECT_EQ(std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Point)), 0);
  ASSERT_EQ(a.loads.size(), b.loads.size());
  for (std::size_t i = 0; i < a.loads.size(); ++i) {
    EXPECT_EQ(a.loads[i].mean.force, b.loads[i].mean.force);
    EXPECT_EQ(a.loads[i].mean.torque, b.loads[i].mean.torque);
  }
}

TEST_F(OnGpu, CloudsAndEnergiesAreTheCpus) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
  MpmTissue cpu(scene);
  CudaMpmTissue gpu(scene);
  deform(cpu.state());
  deform(gpu.state());
  shake(cpu.state(), 3, 2e-5);
  shake(gpu.state(), 3, 2e-5);
  gpu.push();
  const BladePath path = plane_cut(Vec3(0.018, 0.0145, 0.0085), Vec3(1, 0.4, 0.2));
  EXPECT_EQ(cut_now(cpu, path).bonds_broken, cut_now(gpu, path).bonds_broken);
  advance_by(cpu, 0, 1e-4f, {});
  advance_by(gpu, 0, 1e-4f, {});
  const FrameResult a = cpu.finish(), b = gpu.finish();
  EXPECT_NEAR(a.elastic_energy, b.elastic_energy, 1e-5 * a.elastic_energy);
  EXPECT_NEAR(a.kinetic_energy, b.kinetic_energy, 1e-5 * a.kinetic_energy);
  EXPECT_NEAR(a.max_speed, b.max_speed, 1e-5 * a.max_speed);
  EXPECT_NEAR(cpu.stable_substep(), gpu.stable_substep(), 1e-5f * cpu.stable_substep());
  for (std::size_t i = 0; i < cpu.fragments().size(); ++i) {
    const Fragment &f = cpu.fragments()[i], &g = gpu.fragments()[i];
    EXPECT_LT((f.centroid - g.centroid).norm(), 1e-7) << "piece " << f.id;
    EXPECT_LT((f.velocity - g.velocity).norm(), 1e-6) << "piece " << f.id;
    EXPECT_LT((f.box.max - g.box.max).norm(), 1e-6) << "piece " << f.id;
  }
  for (int k = 0; k < 4; ++k) {
    PointSelection selection;
    selection.stride = k == 1 ? 3 : 1;
    selection.surface_only = k == 2;
    selection.loose_only = k == 3;
    std::vector<std::uint8_t> x, y;
    ASSERT_EQ(cpu.read_points(selection, x), gpu.read_points(selection, y));
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t i = 0; i < x.size(); i += sizeof(Point)) {
      Point p, q;
      std::memcpy(&p, &x[i], sizeof(Point));
      std::memcpy(&q, &y[i], sizeof(Point));
      ASSERT_EQ(p.id, q.id);
      ASSERT_EQ(p.fragment, q.fragment);
      ASSERT_EQ(p.rgb, q.rgb);
      ASSERT_EQ(p.damage, q.damage);
      ASSERT_NEAR(p.x, q.x, 1e-7);
      ASSERT_NEAR(p.y, q.y, 1e-7);
      ASSERT_NEAR(p.z, q.z, 1e-7);
      ASSERT_NEAR(p.stress, q.stress, 1e-3 * p.stress + 1);
    }
  }
}

}  // namespace
}  // namespace tissue_sim
#else
TEST(OnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
