// Tissue that tears on the GPU, against the CPU and against itself. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cstdio>

#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/tear_scenes.h"

namespace tissue_sim {
namespace {

class TearOnGpu : public OnEitherDevice<CudaMpmTissue> {};

TEST_F(TearOnGpu, FindsThePointsToTearThatTheCpuFinds) {
  Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
  scene.materials[0].tear_stretch = 1.25;
  scene.materials[0].tear_scatter = 0.1;
  MpmTissue cpu(scene);
  CudaMpmTissue gpu(scene);
  deform(cpu.state());
  deform(gpu.state());
  gpu.push();
  // No substep: what tears in the first of them is what is past its limit now.
  advance_by(cpu, 1, 1e-7f, {});
  advance_by(gpu, 1, 1e-7f, {});
  const FrameResult a = cpu.finish(), b = gpu.finish();
  EXPECT_GT(a.tear_report.bonds_broken, 0);
  // Points at the very limit may fall on either side.
  EXPECT_NEAR(static_cast<double>(b.tear_report.bonds_broken),
              static_cast<double>(a.tear_report.bonds_broken), 2);
}

/// A hanging strip with a notch that its own weight, many times the earth's, tears.
Scene heavy_strip() {
  StripOf of;
  of.scatter = 0.02;
  Scene s = Strip<MpmTissue>::scene_of(of);
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, -1);
  held.max = Vec3(0.004, 1, 1);
  s.bodies[0].anchors = {held};
  s.gravity = Vec3(60, 0, 0);
  s.damping = 20;
  return s;
}

TEST_F(TearOnGpu, TissueTearsAsOnTheCpu) {
  MpmTissue cpu(heavy_strip());
  CudaMpmTissue gpu(heavy_strip()), again(heavy_strip());
  const BladePath notch = upright_blade({Vec3(0.0141, -0.02, 0), Vec3(0.0141, 0.0061, 0)});
  const auto run = [&](auto& tissue, std::vector<std::uint64_t>& checksums) {
    cut_now(tissue, notch);
    std::int64_t broken = 0;
    for (int i = 0; i < 60; ++i) {
      advance_by(tissue, 100, 5e-5f, {});
      const FrameResult r = tissue.finish();
      EXPECT_FALSE(r.blew_up) << "in frame " << i;
      broken += r.tear_report.bonds_broken;
      checksums.push_back(tissue.checksum());
    }
    return broken;
  };
  std::vector<std::uint64_t> of_cpu, first, second;
  const std::int64_t a = run(cpu, of_cpu), b = run(gpu, first);
  run(again, second);
  EXPECT_EQ(first, second) << "the same bits";
  EXPECT_GT(a, 20);
  EXPECT_NEAR(static_cast<double>(b), static_cast<double>(a), 0.2 * a);
  const std::vector<int> of_a = piece_sizes(cpu), of_b = piece_sizes(gpu);
  ASSERT_GE(of_a.size(), 2u);
  ASSERT_GE(of_b.size(), 2u);
  EXPECT_NEAR(of_a[0], of_b[0], 0.02 * of_a[0]);
  EXPECT_NEAR(of_a[1], of_b[1], 0.02 * of_a[0]);
  std::printf("torn bonds: CPU %lld, GPU %lld\n", static_cast<long long>(a),
              static_cast<long long>(b));
}

}  // namespace
}  // namespace tissue_sim
#else
TEST(TearOnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
