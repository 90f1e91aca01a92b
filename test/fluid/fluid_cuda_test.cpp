// Fluid on a GPU against the same on a CPU.
#if defined(TISSUE_SIM_CUDA)
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "compute/cuda_check.h"
#include "fluid/fluid_device.h"

namespace tissue_sim {
namespace {

/// A ball of triangles that look inwards, dented at random; drops of two fluids in it that move at
/// random, some beside what the walls come to.
struct Cavity {
  Cpu cpu{1};
  FluidState fluid;
  FluidWalls walls;

  Cavity() {
    constexpr float kSpacing = 0.002f, kRadius = 0.012f;
    constexpr int kRings = 9, kSides = 14;
    fluid.cpu = &cpu;
    fluid.spacing = kSpacing;
    fluid.kernel.reach = kFluidReach * kSpacing;
    fluid.laws = {{1000, 0.001f, 1e5f}, {1300, 0.02f, 2e5f}};
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(-1, 1);
    std::vector<Vec3> dents(1000);
    for (Vec3& d : dents) d = 0.0004 * Vec3(any(random), any(random), any(random));
    const auto place = [&](int ring, int side) {
      const double polar = M_PI * ring / kRings, around = 2 * M_PI * (side % kSides) / kSides;
      const int dent = ring == 0 || ring == kRings ? ring : 20 + ring * kSides + side % kSides;
      return Vec3(kRadius * Vec3(std::sin(polar) * std::cos(around),
                                 std::sin(polar) * std::sin(around), std::cos(polar)) +
                  dents[dent]);
    };
    const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
      for (const Vec3& x : {a, c, b}) {
        for (int k = 0; k < 3; ++k) walls.begin.push_back(static_cast<float>(x[k]));
      }
    };
    for (int ring = 0; ring < kRings; ++ring) {
      for (int side = 0; side < kSides; ++side) {
        const Vec3 a = place(ring, side), b = place(ring + 1, side), c = place(ring + 1, side + 1),
                   d = place(ring, side + 1);
        if (ring + 1 < kRings) add(a, b, c);
        if (ring > 0) add(a, c, d);
      }
    }
    walls.end = walls.begin;
    for (std::size_t i = 0; i < walls.end.size(); ++i) {
      walls.end[i] *= 1 - 0.02f * (1 + std::sin(i % 3 + 300 * walls.begin[i]));
    }
    for (double x = -kRadius; x < kRadius; x += kSpacing) {
      for (double y = -kRadius; y < kRadius; y += kSpacing) {
        for (double z = -kRadius; z < 0.4 * kRadius; z += kSpacing) {
          const Vec3 at(x, y, z);
          if (at.norm() > 0.93 * kRadius) continue;
          const Vec3 off(any(random), any(random), any(random)),
              v(any(random), any(random), any(random));
          add_particle(fluid, at + 0.15 * kSpacing * off, 0.4 * v,
                       (1.05 + 0.1 * any(random)) * std::pow(kSpacing, 3), x > 0 ? 1 : 0, -1);
        }
      }
    }
    sort_particles(fluid);
  }
};

double largest(const Array<float>& of) {
  double most = 0;
  for (const float x : of) most = std::max<double>(most, std::fabs(x));
  return most;
}

TEST(FluidOnAGpu, MovesAsOnACpu) {
  if (!why_no_gpu().empty()) GTEST_SKIP() << why_no_gpu();
  Cavity on_cpu, on_gpu;
  FluidDrive drive;
  drive.gravity = Vec3(1, -2, -9);
  drive.damping = 0.5;
  drive.duration = 0.9 * stable_fluid_step(on_cpu.fluid, 1);
  drive.colliders = [](double share) {
    Collider ball, plane;
    ball.kind = Collider::kCapsule;
    ball.radius = 0.003f;
    ball.length = 0.02f;
    ball.position[0] = 0.004f + 0.0002f * static_cast<float>(share);
    ball.velocity[0] = 0.3f;
    plane.position[2] = -0.0085f;
    return std::vector<Collider>{ball, plane};
  };
  std::vector<ColliderLoad> loads(2), gpu_loads(2);
  on_cpu.walls.impulse.assign(on_cpu.walls.end.size() / 3, 0);
  EXPECT_EQ(advance_fluid(on_cpu.fluid, drive, on_cpu.walls, loads), 1);
  const std::unique_ptr<FluidDevice> device = make_fluid_on_gpu();
  device->send(on_gpu.fluid);
  device->set_walls(on_gpu.walls.begin.data(), on_gpu.walls.size(), true);
  device->set_walls(on_gpu.walls.end.data(), on_gpu.walls.size(), false);
  EXPECT_EQ(device->advance(on_gpu.fluid, drive, gpu_loads), 1);
  device->bring(on_gpu.fluid);
  device->bring_impulses(on_gpu.walls);

  const FluidParticles &a = on_cpu.fluid.particles, &b = on_gpu.fluid.particles;
  ASSERT_EQ(a.size(), b.size());
  const double speed = std::max({largest(a.v[0]), largest(a.v[1]), largest(a.v[2])});
  const double pressure = largest(a.pressure);
  EXPECT_GT(pressure, 1000);
  double off_x = 0, off_v = 0, off_p = 0;
  for (int i = 0; i < a.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      off_x = std::max<double>(off_x, std::fabs(a.x[k][i] - b.x[k][i]));
      off_v = std::max<double>(off_v, std::fabs(a.v[k][i] - b.v[k][i]));
    }
    off_p = std::max<double>(off_p, std::fabs(a.pressure[i] - b.pressure[i]));
  }
  double impulse = 0, off_impulse = 0;
  for (std::size_t i = 0; i < on_cpu.walls.impulse.size(); ++i) {
    const double x = on_cpu.walls.impulse[i];
    impulse = std::max(impulse, std::fabs(x));
    off_impulse = std::max(off_impulse, std::fabs(x - on_gpu.walls.impulse[i]));
  }
  EXPECT_GT(impulse, 0);
  EXPECT_LT(off_x / on_cpu.fluid.spacing, 1e-4);
  EXPECT_LT(off_v / speed, 1e-4);
  EXPECT_LT(off_p / pressure, 1e-4);
  EXPECT_LT(off_impulse / impulse, 1e-4);
  for (int c = 0; c < 2; ++c) {
    const Vec3 f(loads[c].force), g(gpu_loads[c].force), t(loads[c].torque), u(gpu_loads[c].torque);
    EXPECT_GT(f.norm(), 0);
    EXPECT_LT((f - g).norm() / f.norm(), 1e-4);
    EXPECT_LT((t - u).norm() / t.norm(), 1e-4);
  }
  RecordProperty("off", std::to_string(off_x / on_cpu.fluid.spacing) + " " +
                            std::to_string(off_v / speed) + " " + std::to_string(off_p / pressure) +
                            " " + std::to_string(off_impulse / impulse));
}

}  // namespace
}  // namespace tissue_sim
#endif
