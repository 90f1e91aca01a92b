// Tissue that nothing pushes stands still, with and without fused multiply-add.
#include <gtest/gtest.h>

#include <cstdlib>
#include <stdexcept>
#include <tuple>

#include "compute/simd.h"
#include "support/cut_paths.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class AtRest : public testing::TestWithParam<std::tuple<MethodOnDevice, const char*>> {
 protected:
  void SetUp() override {
    const auto [on, set] = GetParam();
    if (!why_not(on).empty()) GTEST_SKIP() << why_not(on);
    setenv("TISSUE_SIM_INSTRUCTION_SET", set, 1);
    try {
      instruction_set();
    } catch (const std::runtime_error& e) {
      GTEST_SKIP() << e.what();
    }
  }
  void TearDown() override { unsetenv("TISSUE_SIM_INSTRUCTION_SET"); }
};

TEST_P(AtRest, TissueThatNothingPushesStandsStill) {
  const MethodOnDevice on = std::get<0>(GetParam());
  const Tolerances within = tolerances(on.method);
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    for (const double modulus : {700.0, 1234.5, 5000.0, 33333.0}) {
      Scene scene = free_box(Vec3(0.011, 0.009, 0.007), 0.002);  // with partial cells
      scene.method = on.method;
      scene.device = on.device;
      Material material;
      material.name = "at rest";
      material.law = law;
      material.young_modulus = modulus;
      material.poisson_ratio = 0.43;
      scene.materials = {material};
      scene.bodies[0].material = "at rest";
      Simulation simulation(scene);
      simulation.advance_frame();
      const FrameResult result = simulation.advance_frame().result;
      EXPECT_TRUE(is_at_most("tissue that nothing pushes: speed", result.max_speed,
                             within.rest_speed, "m/s"))
          << "law " << static_cast<int>(law) << ", " << modulus << " Pa";
      EXPECT_TRUE(is_at_most("its energy", result.elastic_energy, within.rest_energy, "J"))
          << "law " << static_cast<int>(law) << ", " << modulus << " Pa";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Each, AtRest,
                         testing::Combine(testing::ValuesIn(methods_on_devices()),
                                          testing::Values("sse2", "avx2", "avx512")),
                         [](const auto& info) {
                           return text(std::get<0>(info.param)) + "_" + std::get<1>(info.param);
                         });

}  // namespace
}  // namespace tissue_sim
