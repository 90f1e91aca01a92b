// The same functor on the CPU and on the GPU.
#include <gtest/gtest.h>

#include <vector>

#include "compute/device_array.h"
#include "compute/for_each_cuda.h"
#include "mpm/blocks/update_node.h"

namespace tissue_sim {
namespace {

/// Moves node i on by the forces of an array.
struct MoveNode {
  UpdateNode update;
  const float* force;
  TISSUE_SIM_INLINE void operator()(int i) const {
    update(i, force[3 * i], force[3 * i + 1], force[3 * i + 2]);
  }
};

TEST(ForEach, DoesTheSameOnTheGpuAsOnTheCpu) {
  const std::string why = why_no_gpu();
  if (!why.empty()) GTEST_SKIP() << why;
  constexpr int kCount = 1000;
  std::vector<float> data(11 * kCount);  // u, v, mass, 1/mass, forces
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = 0.01f * static_cast<float>(i * 37 % 101);
  DeviceArray<float> on_gpu;
  on_gpu.upload(data, nullptr);
  const auto kernel_on = [](float* at) {
    MoveNode k;
    for (int c = 0; c < 3; ++c) {
      k.update.u[c] = at + c * kCount;
      k.update.v[c] = at + (3 + c) * kCount;
      k.update.gravity[c] = static_cast<float>(c) - 1.5f;
    }
    k.update.mass = at + 6 * kCount;
    k.update.inv_mass = at + 7 * kCount;
    k.update.dt = 0.125f;
    k.update.keep = 0.5f;
    k.force = at + 8 * kCount;
    return k;
  };
  const Gpu gpu;
  gpu.for_each(kCount, kernel_on(on_gpu.data()));
  gpu.wait();
  const MoveNode on_cpu = kernel_on(data.data());
  for (int i = 0; i < kCount; ++i) on_cpu(i);
  std::vector<float> back(data.size());
  on_gpu.download(back.data(), back.size(), nullptr);
  gpu.wait();
  for (std::size_t i = 0; i < data.size(); ++i) {
    ASSERT_NEAR(back[i], data[i], 1e-5f * (1 + std::abs(data[i])));
  }
}

}  // namespace
}  // namespace tissue_sim
