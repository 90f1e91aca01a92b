// Whole tissue whose blocks a GPU marches through. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "compute/cuda_check.h"
#include "cut_scenes.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {
namespace {

/// With blocks of the shape that the parameter names.
class MarchOnGpu : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
    setenv("TISSUE_SIM_CUDA_SHAPE", GetParam(), 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};

/// A held box of whole points: 34 x 18 x 20 cells.
Scene whole_box() {
  Scene scene = held_body(Law::kFixedCorotated, 0, Shape::kBox);
  scene.cell_size = 0.001;
  scene.bodies[0].size = Vec3(0.034, 0.018, 0.020);
  scene.bodies[0].pose.position = 0.5 * scene.bodies[0].size;
  return scene;
}

TEST_P(MarchOnGpu, AgreesWithTheCpuAndGivesTheSameBitsRunAfterRun) {
  const Scene scene = whole_box();
  MpmTissue cpu(scene);
  CudaMpmTissue gpu(scene), again(scene);
  std::printf("%s\n", gpu.plan().c_str());
  for (MpmState* state : {&cpu.state(), &gpu.state(), &again.state()}) shake(*state, 5, 2e-5);
  const float dt = 5e-5f;
  cpu.advance(20, dt, {});
  cpu.finish();
  for (CudaMpmTissue* tissue : {&gpu, &again}) {
    tissue->push();
    tissue->advance(20, dt, {});
    tissue->finish();
    tissue->pull();
  }
  EXPECT_EQ(gpu.checksum(), again.checksum());
  double worst = 0, fastest = 0;
  const Nodes &a = cpu.state().nodes, &b = gpu.state().nodes;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      if (a.inv_mass[i] == 0) continue;
      worst = std::max<double>(worst, std::fabs(a.v[c][i] - b.v[c][i]));
      fastest = std::max<double>(fastest, std::fabs(a.v[c][i]));
    }
  }
  EXPECT_LT(worst, 1e-4 * fastest);
}

INSTANTIATE_TEST_SUITE_P(Shapes, MarchOnGpu,
                         testing::Values("16 16 8 256 2", "2 2 3 192 2", "5 3 2 192 2",
                                         "8 4 1 32 2"));

}  // namespace
}  // namespace tissue_sim
#endif
