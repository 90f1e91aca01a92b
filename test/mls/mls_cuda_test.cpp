// The meshless method on a GPU, against the double-precision reference and against the CPU.
#if defined(TISSUE_SIM_CUDA)
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "compute/cuda_check.h"
#include "mls/cuda/cuda_mls_tissue.h"
#include "mls/mls_scenes.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

class MlsOnGpu : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
  }
};

double difference(const std::vector<Vec3>& expected, const Array<float>& force) {
  double most = 0, off = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    most = std::max(most, expected[i].norm());
    const Vec3 f(force[4 * i], force[4 * i + 1], force[4 * i + 2]);
    off = std::max(off, (f - expected[i]).norm());
  }
  return off / most;
}

TEST_F(MlsOnGpu, ForcesAreThoseOfTheReference) {
  for (const MlsPlacement placement : {MlsPlacement::kRegular, MlsPlacement::kGraded}) {
    for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
      for (const bool is_cut : {false, true}) {
        Scene scene = mls_box(Vec3(0.013, 0.011, 0.009), 0.001, placement);
        Material m;
        m.name = scene.bodies[0].material = "test";
        m.law = law;
        scene.materials.push_back(m);
        CudaMlsTissue tissue(scene);
        MlsState& s = tissue.state();
        Eigen::Matrix3d A;
        A << 0.2, 0.15, -0.1, 0.1, -0.15, 0.05, 0, 0.1, 0.1;
        if (is_cut) {
          EXPECT_GT(
              tissue.cut_now(plane_cut(Vec3(0.006, 0.005, 0.004), Vec3(1, 0.6, 0.3))).bonds_broken,
              0);
        }
        impose(s, A);
        std::mt19937 random(1);
        for (std::size_t k = 0; k < s.u.size(); ++k) {
          if (k % 4 != 3) s.u[k] += 1e-4f * (static_cast<float>(random()) / 4294967296.0f - 0.5f);
        }
        tissue.push();
        Array<float> force(s.u.size());
        tissue.forces_at(s.u.data(), force.data(), 1);
        EXPECT_LT(difference(reference::mls_forces(s), force), 1e-4)
            << "placement " << static_cast<int>(placement) << (is_cut ? ", cut" : "");
      }
    }
  }
}

Scene pressed_slab(Device device) {
  Scene scene = mls_box(Vec3(0.03, 0.02, 0.01), 0.00125);
  scene.device = device;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  scene.damping = 5;
  scene.tools.resize(1);
  Material m;
  m.name = scene.bodies[0].material = "test";
  m.viscosity = 1;
  scene.materials.push_back(m);
  return scene;
}

struct Pressed {
  std::vector<Vec3> places;
  std::vector<int> pieces;
  double force = 0;
  std::uint64_t checksum = 0;
};

/// A probe presses, a blade cuts, the probe leaves.
Pressed press(Device device) {
  Simulation simulation(pressed_slab(device));
  const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  Pressed result;
  for (int frame = 0; frame < 12; ++frame) {
    const double depth = 0.0004 * std::min(frame, 12 - frame);
    simulation.set_tool(0, {Vec3(0.008, 0.01, 0.01 - depth), down});
    if (frame == 4) simulation.cut(upright_blade({Vec3(0.02, -0.1, 0), Vec3(0.02, 0.1, 0)}));
    const FrameReport report = simulation.advance_frame();
    EXPECT_FALSE(report.result.blew_up);
    result.force = std::max(result.force, report.result.loads[0].mean.force.norm());
    if (frame == 4) {
      EXPECT_EQ(report.result.cut_reports[0].new_fragments.size(), 1u);
    }
  }
  std::vector<std::uint8_t> cloud;
  const int count = simulation.tissue().read_points({}, cloud);
  for (int i = 0; i < count; ++i) {
    Point p;
    std::memcpy(&p, cloud.data() + i * sizeof(Point), sizeof(Point));
    result.places.emplace_back(p.x, p.y, p.z);
  }
  for (const Fragment& f : simulation.tissue().fragments()) result.pieces.push_back(f.point_count);
  result.checksum = simulation.tissue().checksum();
  return result;
}

TEST_F(MlsOnGpu, PressedAndCutItMovesAsOnTheCpu) {
  const Pressed cpu = press(Device::kCpu), gpu = press(Device::kCuda);
  ASSERT_EQ(cpu.places.size(), gpu.places.size());
  double worst = 0;
  for (std::size_t i = 0; i < cpu.places.size(); ++i) {
    worst = std::max(worst, (cpu.places[i] - gpu.places[i]).norm());
  }
  EXPECT_LT(worst, 2e-5) << "of 2.4 mm that it was pressed";
  EXPECT_EQ(cpu.pieces, gpu.pieces);
  EXPECT_GT(cpu.force, 1e-3);
  EXPECT_NEAR(gpu.force, cpu.force, 1e-3 * cpu.force);
}

TEST_F(MlsOnGpu, TheSameBitsRunAfterRun) {
  EXPECT_EQ(press(Device::kCuda).checksum, press(Device::kCuda).checksum);
}

TEST_F(MlsOnGpu, AStateGoesOnWithTheSameBits) {
  const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const auto run = [&](Simulation& simulation, int from, int to) {
    for (int frame = from; frame < to; ++frame) {
      simulation.set_tool(0, {Vec3(0.008, 0.01, 0.01 - 0.0002 * frame), down});
      simulation.advance_frame();
    }
    return simulation.tissue().checksum();
  };
  Simulation whole(pressed_slab(Device::kCuda)), other(pressed_slab(Device::kCuda));
  run(whole, 0, 5);
  const std::vector<std::uint8_t> saved = whole.save();
  other.restore(saved);
  EXPECT_EQ(run(whole, 5, 9), run(other, 5, 9));
}

}  // namespace
}  // namespace tissue_sim
#endif
