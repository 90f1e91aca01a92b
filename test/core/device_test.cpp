// Which device a scene runs on, and what is said about it.
#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "support/cut_scenes.h"
#include "tissue_sim/tissue.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#endif

namespace tissue_sim {
namespace {

Scene scene_on(Device device) {
  Scene scene = free_box(Vec3(0.02, 0.02, 0.02), 0.005);
  scene.device = device;
  return scene;
}

TEST(DeviceOfScene, CpuNeedsNoWord) {
  const std::unique_ptr<Tissue> tissue = make_tissue(scene_on(Device::kCpu));
  EXPECT_EQ(tissue->device_name().find("cpu"), 0u) << tissue->device_name();
  EXPECT_TRUE(tissue->notes().empty());
}

#if defined(TISSUE_SIM_CUDA)
TEST(DeviceOfScene, AutoIsTheGpuOrSaysWhyItIsNot) {
  const std::string why = why_no_gpu();
  const std::unique_ptr<Tissue> tissue = make_tissue(scene_on(Device::kAuto));
  if (why.empty()) {
    EXPECT_EQ(tissue->device_name().find("cuda"), 0u) << tissue->device_name();
    EXPECT_TRUE(tissue->notes().empty());
  } else {
    EXPECT_EQ(tissue->device_name().find("cpu"), 0u) << tissue->device_name();
    ASSERT_EQ(tissue->notes().size(), 1u);
    EXPECT_EQ(tissue->notes()[0], "runs on the CPU: " + why + "; set device to cpu");
    std::printf("%s\n", tissue->notes()[0].c_str());
  }
}

TEST(DeviceOfScene, CudaIsRefusedWhereItCannotBeUsed) {
  if (why_no_gpu().empty()) GTEST_SKIP() << "there is a GPU";
  EXPECT_THROW(make_tissue(scene_on(Device::kCuda)), std::runtime_error);
}
#endif

}  // namespace
}  // namespace tissue_sim
