// Tissue that nothing pushes stands still to the last bit, with and without fused multiply-add.
#include <gtest/gtest.h>

#include <cstdlib>
#include <stdexcept>

#include "compute/simd.h"
#include "cut_scenes.h"

namespace tissue_sim {
namespace {

class AtRest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    setenv("TISSUE_SIM_INSTRUCTION_SET", GetParam(), 1);
    try {
      instruction_set();
    } catch (const std::runtime_error& e) {
      GTEST_SKIP() << e.what();
    }
  }
  void TearDown() override { unsetenv("TISSUE_SIM_INSTRUCTION_SET"); }
};

TEST_P(AtRest, TissueThatNothingPushesStandsStill) {
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    for (const double modulus : {700.0, 1234.5, 5000.0, 33333.0}) {
      Scene scene = free_box(Vec3(0.011, 0.009, 0.007), 0.002);  // with partial cells
      Material material;
      material.name = "at rest";
      material.law = law;
      material.young_modulus = modulus;
      material.poisson_ratio = 0.43;
      scene.materials = {material};
      scene.bodies[0].material = "at rest";
      MpmTissue tissue(scene);
      tissue.advance(20, 1e-4f, {});
      const FrameResult result = tissue.finish();
      EXPECT_EQ(result.max_speed, 0) << "law " << static_cast<int>(law) << ", " << modulus << " Pa";
      EXPECT_EQ(result.elastic_energy, 0)
          << "law " << static_cast<int>(law) << ", " << modulus << " Pa";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(With, AtRest, testing::Values("sse2", "avx2", "avx512"));

}  // namespace
}  // namespace tissue_sim
