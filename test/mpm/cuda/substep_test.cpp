// One substep on the GPU against brute force in double precision. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cstdlib>

#include "compute/cuda_check.h"
#include "reference/mpm_reference.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

struct Case {
  const char* name;
  Law law;
  double viscosity;
  int cuts;
  const char* shape;       // of the GPU's blocks, null for the default
  bool materials = false;  // several, of both laws
};
std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.name << " " << (c.shape == nullptr ? "" : c.shape);
}

class OnGpuWith : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
    if (GetParam().shape != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", GetParam().shape, 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};

TEST_P(OnGpuWith, OneSubstepAgreesWithBruteForce) {
  for (const Shape shape : {Shape::kBox, Shape::kEllipsoid}) {
    Scene scene = free_body(GetParam().law, GetParam().viscosity, shape);
    if (GetParam().materials) add_inclusions(scene, true);
    CudaMpmTissue tissue(scene);
    MpmState& state = tissue.state();
    deform(state);
    tissue.push();
    const Vec3 middle(0.0155, 0.0145, 0.0085);
    if (GetParam().cuts > 0) {
      ASSERT_GT(cut_now(tissue, plane_cut(middle, Vec3(1, 0.4, 0.2))).bonds_broken, 0);
    }
    if (GetParam().cuts > 1) cut_now(tissue, plane_cut(middle, Vec3(-0.3, 1, 0.1)));
    tissue.pull();
    shake(state, 7, 8e-5);
    tissue.push();
    state.faces.until_search = 1e9;  // faces that are shaken into one another do not push
    std::printf("%s\n", tissue.plan().c_str());
    const float dt = 1e-4f;
    const reference::Step expected = reference::substep(state, dt);
    EXPECT_GT(expected.largest_strain, 0.1) << "the state must be deformed to tell anything";
    advance_by(tissue, 1, dt, {});
    tissue.finish();
    tissue.pull();
    double force_scale = 0, v_scale = 0;
    for (std::size_t i = 0; i < expected.u.size(); ++i) {
      force_scale = std::max(force_scale, expected.force[i].norm());
      v_scale = std::max(v_scale, expected.v[i].norm());
    }
    for (std::size_t i = 0; i < expected.u.size(); ++i) {
      if (state.nodes.inv_mass[i] == 0) continue;
      const Vec3 v(state.nodes.v[0][i], state.nodes.v[1][i], state.nodes.v[2][i]);
      const Vec3 u(state.nodes.u[0][i], state.nodes.u[1][i], state.nodes.u[2][i]);
      const double v_bound = 2e-6 * force_scale * dt / expected.mass[i] + 1e-6 * v_scale;
      ASSERT_LT((v - expected.v[i]).norm(), v_bound) << "node " << i;
      ASSERT_LT((u - expected.u[i]).norm(), dt * v_bound + 1e-8) << "node " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, OnGpuWith,
    testing::Values(Case{"fixed corotated", Law::kFixedCorotated, 0, 0, nullptr},
                    Case{"neo-Hookean", Law::kNeoHookean, 0, 0, nullptr},
                    Case{"viscous", Law::kFixedCorotated, 3, 0, nullptr},
                    Case{"cut", Law::kFixedCorotated, 0, 1, nullptr},
                    Case{"cut crosswise, viscous", Law::kNeoHookean, 2, 2, nullptr},
                    Case{"materials", Law::kFixedCorotated, 0, 0, nullptr, true},
                    Case{"materials, cut, viscous", Law::kNeoHookean, 2, 2, nullptr, true},
                    Case{"a wave after the other", Law::kFixedCorotated, 0, 0, "4 4 4 32 0"},
                    Case{"the same, cut", Law::kFixedCorotated, 0, 2, "3 5 2 32 0"},
                    Case{"flat blocks", Law::kNeoHookean, 0, 1, "16 4 1 128 1"},
                    Case{"a thread a column", Law::kNeoHookean, 0, 0, "8 8 2 64 1"},
                    Case{"the same, cut", Law::kFixedCorotated, 0, 2, "16 6 2 96 1"},
                    Case{"several to a thread block", Law::kFixedCorotated, 0, 0, "8 2 1 256 1"},
                    Case{"the same, cut", Law::kNeoHookean, 0, 2, "8 2 1 256 1"},
                    Case{"a few more than at once", Law::kFixedCorotated, 0, 2, "2 2 3 192 0"},
                    Case{"large blocks, cut", Law::kFixedCorotated, 0, 2, "16 16 16 256 0"}));

}  // namespace
}  // namespace tissue_sim
#endif
