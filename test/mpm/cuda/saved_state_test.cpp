// States of tissue on a GPU whose blocks are divided anew by the first cut, or halved. Skipped
// where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cstdlib>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "tissue/saved_states.h"

namespace tissue_sim {
namespace {

class SavedStateOnGpu : public OnEitherDevice<CudaMpmTissue> {
 protected:
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
  /// A held box under a probe, which is cut in the middle of the run and then once more.
  static SavedRun run_of(const Vec3& size, double cell_size, int frames) {
    SavedRun run;
    run.scene = free_body(Law::kFixedCorotated, 0, Shape::kBox);
    run.scene.device = Device::kCuda;
    run.scene.cell_size = cell_size;
    run.scene.bodies[0].size = size;
    run.scene.bodies[0].pose.position = 0.5 * size;
    Region held;
    held.kind = Region::Kind::kBox;
    held.min = Vec3(-1, -1, -1);
    held.max = Vec3(0.006, 1, 1);
    run.scene.bodies[0].anchors = {held};
    run.scene.tools.resize(1);
    run.scene.tools[0].name = "probe";
    run.scene.tools[0].radius = 0.004;
    run.frames = frames;
    run.every = 2;
    run.inputs = [size, frames](Simulation& simulation, std::int64_t frame) {
      const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
      const double depth = 0.004 * static_cast<double>(frame) / frames;
      simulation.set_tool(0,
                          {Vec3(0.6 * size.x(), 0.4 * size.y(), size.z() + 0.002 - depth), down});
      if (frame == frames / 2) simulation.cut(plane_cut(0.5 * size, Vec3(1, 0.4, 0.3)));
      if (frame == frames / 2 + 2) simulation.cut(plane_cut(0.5 * size, Vec3(0.2, 1, 0.1)));
    };
    return run;
  }
  /// The shape of its blocks.
  static std::string cells(Simulation& simulation) {
    const std::string of = plan(on_gpu(dynamic_cast<MpmTissue&>(simulation.tissue())));
    return of.substr(0, of.find(" cells"));
  }
  /// Returns the simulation at the end of the run.
  static std::unique_ptr<Simulation> goes_on(const SavedRun& run) {
    auto whole = go_on_from_states(run);
    EXPECT_GE(whole->tissue().fragment_count(), 4);
    return whole;
  }
  static void goes_on_divided_anew(const SavedRun& run) {
    cudaDeviceProp gpu;
    ASSERT_EQ(cudaGetDeviceProperties(&gpu, 0), cudaSuccess);
    if (gpu.multiProcessorCount != 132) GTEST_SKIP() << "the size is for 132 multiprocessors";
    Simulation before(run.scene);
    const auto whole = goes_on(run);
    EXPECT_NE(cells(before), cells(*whole));
  }
};

TEST_F(SavedStateOnGpu, GoesOnWhereTheFirstCutDividesTissueAnew) {
  goes_on_divided_anew(run_of(Vec3(0.040, 0.040, 0.018), 0.002, 12));
}

TEST_F(SavedStateOnGpu, GoesOnWhereRegionsAreHalved) {
  setenv("TISSUE_SIM_CUDA_SHAPE", "6 5 4 96 0", 1);
  const auto whole = goes_on(run_of(Vec3(0.031, 0.029, 0.017), 0.002, 12));
  EXPECT_TRUE(dynamic_cast<MpmTissue&>(whole->tissue()).state().blocks.has_halves());
}

}  // namespace
}  // namespace tissue_sim
#endif
