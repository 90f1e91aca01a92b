// Whole tissue whose blocks a GPU marches through. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "compute/cuda_check.h"
#include "cut_scenes.h"
#include "either_device.h"
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

/// After two frames of so many substeps, with what instruments there are.
void agrees(const Scene& scene, const std::vector<ToolMotion>& tools, int substeps) {
  MpmTissue cpu(scene);
  CudaMpmTissue gpu(scene), again(scene);
  std::printf("%s\n", gpu.plan().c_str());
  for (MpmState* state : {&cpu.state(), &gpu.state(), &again.state()}) shake(*state, 5, 2e-5);
  push(cpu);
  push(gpu);
  push(again);
  const float dt = 5e-5f;
  FrameResult expected, found[2];
  for (int frame = 0; frame < 2; ++frame) {
    cpu.advance(substeps, dt, {tools, {}});
    expected = cpu.finish();
    for (CudaMpmTissue* tissue : {&gpu, &again}) {
      tissue->advance(substeps, dt, {tools, {}});
      found[tissue == &again ? 1 : 0] = tissue->finish();
    }
  }
  gpu.pull();
  EXPECT_EQ(gpu.checksum(), again.checksum());
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const Wrench &a = expected.loads[i].mean, &b = found[0].loads[i].mean;
    EXPECT_GT(a.force.norm(), 1e-3) << "tool " << i;
    EXPECT_LT((a.force - b.force).norm(), 1e-4 * a.force.norm());
    EXPECT_LT((a.torque - b.torque).norm(), 1e-4 * (a.torque.norm() + 0.01 * a.force.norm()));
    EXPECT_EQ(b.force, found[1].loads[i].mean.force);
  }
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

TEST_P(MarchOnGpu, AgreesWithTheCpuAndGivesTheSameBitsRunAfterRun) { agrees(whole_box(), {}, 20); }

TEST_P(MarchOnGpu, AgreesBesideTools) {
  Scene scene = whole_box();
  scene.tools.resize(2);
  std::vector<ToolMotion> tools(2);
  for (int i = 0; i < 2; ++i) {
    scene.tools[i].name = i == 0 ? "left" : "right";
    // Over edges of blocks, from above and from the side, pressed in and dragged.
    ToolMotion& m = tools[i];
    m.present = true;
    m.begin.position = i == 0 ? Vec3(0.017, 0.008, 0.019) : Vec3(0.022, 0.001, 0.010);
    m.begin.orientation =
        Quat::FromTwoVectors(Vec3::UnitZ(), i == 0 ? Vec3(0, 0, -1) : Vec3(0, 1, 0));
    m.end = m.begin;
    m.end.position += Vec3(5e-5, 3e-5, -3e-5);
  }
  agrees(scene, tools, 5);  // then it has left them
}

INSTANTIATE_TEST_SUITE_P(Shapes, MarchOnGpu,
                         testing::Values("16 16 8 256 2", "2 2 3 192 2", "5 3 2 192 2",
                                         "8 4 1 32 2"));

}  // namespace
}  // namespace tissue_sim
#endif
