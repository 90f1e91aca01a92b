// The substep that is chosen on the GPU: the CPU's. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cmath>
#include <cstdio>

#include "compute/device_array.h"
#include "mpm/mpm_tissue.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/drooping_block.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/test_scenes.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

class SubstepOnGpu : public OnEitherDevice<CudaMpmTissue> {};

TEST_F(SubstepOnGpu, IsTheCpus) {
  for (const Shape shape : {Shape::kBox, Shape::kEllipsoid}) {
    for (const double viscosity : {0.0, 2.0}) {
      const Scene scene = free_body(Law::kFixedCorotated, viscosity, shape);
      MpmTissue cpu(scene);
      CudaMpmTissue gpu(scene);
      EXPECT_NEAR(gpu.substep_for({}) / cpu.substep_for({}), 1, 0.05);
      EXPECT_GT(cpu.substep_for({}), 1.1f * cpu.stable_substep());
      deform(cpu.state());
      deform(gpu.state());
      gpu.push();
      advance_by(cpu, 0, 1e-4f, {});
      advance_by(gpu, 0, 1e-4f, {});
      cpu.finish();
      gpu.finish();
      // Its blocks are others, which bound what stiffened; and at a cut it measures all of them.
      EXPECT_NEAR(gpu.substep_for({}) / cpu.substep_for({}), 1, 0.1);
      const BladePath path = plane_cut(Vec3(0.018, 0.0145, 0.0085), Vec3(1, 0.4, 0.2));
      EXPECT_EQ(cut_now(cpu, path).bonds_broken, cut_now(gpu, path).bonds_broken);
      advance_by(cpu, 0, 1e-4f, {});
      advance_by(gpu, 0, 1e-4f, {});
      cpu.finish();
      gpu.finish();
      EXPECT_NEAR(gpu.substep_for({}) / cpu.substep_for({}), 1, 0.1);
    }
  }
}

TEST_F(SubstepOnGpu, MeasuringItChangesNothing) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
  CudaMpmTissue tissue(scene);
  deform(tissue.state());
  tissue.push();
  advance_by(tissue, 0, 1e-4f, {});
  const std::uint64_t before = tissue.checksum();
  for (int frame = 0; frame < 40; ++frame) tissue.finish();  // measured again after 30
  EXPECT_EQ(tissue.checksum(), before);
}

TEST_F(SubstepOnGpu, HoldsWhileTissueIsPressedAndCut) {
  Scene scene = operation_scene(Vec3(0.08, 0.024, 0.028), Vec3(0, 0, 0.02));
  scene.tools[0].blade_length = 0.05;
  const Quat down = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  double energy[2], gain[2] = {};
  for (const Device device : {Device::kCpu, Device::kCuda}) {
    const int which = device == Device::kCuda;
    scene.device = device;
    Simulation simulation(scene);
    for (int frame = 0; frame < 90; ++frame) {
      const double t = frame / 60.0;
      simulation.set_tool(0, {Vec3(0.002 + 0.01 * t, 0.03 - 0.08 * t, -0.001), down});
      simulation.set_tool(1, {Vec3(0.03, -0.003, 0.04 - 0.02 * std::min(t, 1.0)), down});
      const double cautious = dynamic_cast<MpmTissue&>(simulation.tissue()).stable_substep();
      const FrameReport report = simulation.advance_frame();
      ASSERT_FALSE(report.result.blew_up) << frame;
      energy[which] = report.result.elastic_energy;
      gain[which] += report.result.substep / cautious / 90;
      if (frame % 15 != 14) continue;
      const auto pieces = simulation.tissue().fragments();
      const Fragment& piece = pieces[pieces.size() - 1];  // once it is off, the end
      std::printf("%s %2d: %.4e J, probe %.4f N, %zu pieces, this at %.5f %.5f %.5f\n",
                  which == 1 ? "gpu" : "cpu", frame, energy[which],
                  report.result.loads[1].mean.force.z(), pieces.size(), piece.centroid.x(),
                  piece.centroid.y(), piece.centroid.z());
    }
    EXPECT_GT(simulation.tissue().fragments().size(), 1u);
  }
  EXPECT_NEAR(energy[1], energy[0], 0.02 * energy[0]);
  EXPECT_NEAR(gain[1], gain[0], 0.1 * gain[0]);
  EXPECT_GT(gain[1], 1.2);
}

TEST_F(SubstepOnGpu, LightPointsAtAnAnchorDoNotShortenIt) {
  for (const double cell_size : {0.004, 0.003}) {
    const int gpu = substeps_of_drooping_block(Device::kCuda, cell_size);
    const int cpu = substeps_of_drooping_block(Device::kCpu, cell_size);
    EXPECT_NEAR(gpu, cpu, 0.1 * cpu) << cell_size;
  }
}

}  // namespace
}  // namespace tissue_sim
#else
TEST(SubstepOnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
