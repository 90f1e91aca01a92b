// Contact of tissue with tissue on the GPU, one substep at a time. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#include "contact/face_places.h"
#include "cut_scenes.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {
namespace {

class FaceContactOnGpu : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
    if (GetParam() != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", GetParam(), 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};

/// Nodes rush towards the middle, so that all cuts close and press.
void implode(CudaMpmTissue& tissue, const Vec3& middle, double rate) {
  tissue.pull();
  MpmState& s = tissue.state();
  for (const LatticeBody& b : s.bodies) {
    for (int i = 0; i < b.node_count(); ++i) {
      const Vec3 home =
          b.node_position(i % b.pitch_y - 1, i % b.pitch_z / b.pitch_y - 1, i / b.pitch_z - 1);
      const auto set = [&](int node) {
        for (int a = 0; a < 3; ++a) {
          s.nodes.v[a][node] = static_cast<float>(-rate * (home[a] - middle[a]));
        }
      };
      set(b.first_node + i);
      const NodeFields::Split* split = s.fields->split(b.first_node + i);
      if (split == nullptr) continue;
      for (const int field : split->field) set(field);
    }
  }
  tissue.push();
}

/// A deformed body, cut crosswise, whose pieces press on one another, between two looks.
void press(CudaMpmTissue& tissue, float dt) {
  const Vec3 middle(0.0155, 0.0145, 0.0085);
  deform(tissue.state());
  tissue.push();
  cut_now(tissue, plane_cut(middle, Vec3(1, 0.4, 0.2)));
  cut_now(tissue, plane_cut(middle, Vec3(-0.3, 1, 0.1)));
  implode(tissue, middle, 10);
  const FaceContacts& faces = tissue.state().faces;
  for (int i = 0; i < 12 || faces.until_look < dt || faces.until_search < dt; ++i) {
    ASSERT_LT(i, 60);
    tissue.advance(1, dt, {});
    ASSERT_FALSE(tissue.finish().blew_up);
  }
}

TEST_P(FaceContactOnGpu, OneSubstepAgreesWithTheCpusContactsAndBruteForce) {
  CudaMpmTissue tissue(free_box(Vec3(0.031, 0.029, 0.017), 0.002));
  const float dt = 0.5f * tissue.stable_substep();
  press(tissue, dt);
  if (HasFatalFailure()) return;
  tissue.pull();
  MpmState& s = tissue.state();
  shake(s, 5, 2e-5);
  tissue.push();
  std::vector<FaceContact> contacts;
  for (const std::int32_t i : s.faces.active) contacts.push_back(s.faces.all[i]);
  reference::Step expected = reference::substep(s, dt);
  double largest = 0, force_scale = 0, v_scale = 0;
  int touching = 0;
  for (FaceContact& c : contacts) {
    push_faces(s, c, dt);
    const Vec3 force(c.force[0], c.force[1], c.force[2]);
    largest = std::max(largest, force.norm());
    touching += force.norm() > 0 ? 1 : 0;
    for (int k = 0; k < 27; ++k) {
      const auto give = [&](const CellNodes& cell, const AxisWeights& weights, double sign) {
        const int n = cell.lowest[k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3];
        if (s.nodes.inv_mass[n] == 0) return;
        const double w = weights.of[k % 3] * weights.of[3 + k / 3 % 3] * weights.of[6 + k / 9];
        const Vec3 impulse = sign * dt * w * force / expected.mass[n];
        expected.force[n] += sign * w * force;
        expected.v[n] += impulse;
        expected.u[n] += dt * impulse;
      };
      give(c.nodes, c.weights, 1);
      give(c.other_nodes, c.other_weights, -1);
    }
  }
  EXPECT_GT(touching, 50);
  tissue.advance(1, dt, {});
  tissue.finish();
  ASSERT_EQ(s.faces.active.size(), contacts.size()) << "nothing was looked at";
  double worst = 0, worst_hold = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const FaceContact &a = contacts[i], &b = s.faces.all[s.faces.active[i]];
    worst = std::max(
        worst,
        Vec3(a.force[0] - b.force[0], a.force[1] - b.force[1], a.force[2] - b.force[2]).norm());
    for (int c = 0; c < 3; ++c) {
      worst_hold = std::max<double>(worst_hold, std::fabs(a.hold[c] - b.hold[c]));
    }
  }
  std::printf("%d contacts push, with up to %.3g N; off by %.2e of it, their holds by %.1e cells\n",
              touching, largest, worst / largest, worst_hold);
  // Sums of displacements of some millimetres round by half a nanometre, in another order here and
  // there, of 50 micrometres of depth; the damper feels it once more.
  EXPECT_LT(worst, 1e-4 * largest);
  EXPECT_LT(worst_hold, 1e-5);
  tissue.pull();
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    force_scale = std::max(force_scale, expected.force[i].norm());
    v_scale = std::max(v_scale, expected.v[i].norm());
  }
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;
    const Vec3 v(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    const double v_bound =
        (2e-6 * force_scale + 1e-4 * largest) * dt / expected.mass[i] + 1e-6 * v_scale;
    ASSERT_LT((v - expected.v[i]).norm(), v_bound) << "node " << i;
  }
}

TEST_P(FaceContactOnGpu, SameBitsRunAfterRun) {
  std::vector<std::uint64_t> checksums[2];
  for (auto& of_run : checksums) {
    CudaMpmTissue tissue(free_box(Vec3(0.031, 0.029, 0.017), 0.002));
    const float dt = 0.5f * tissue.stable_substep();
    press(tissue, dt);
    if (HasFatalFailure()) return;
    for (int f = 0; f < 10; ++f) {
      tissue.advance(50, dt, {});
      EXPECT_FALSE(tissue.finish().blew_up);
      of_run.push_back(tissue.checksum());
    }
  }
  EXPECT_EQ(checksums[0], checksums[1]);
}

INSTANTIATE_TEST_SUITE_P(Shapes, FaceContactOnGpu,
                         testing::Values(nullptr, "4 4 4 32 0", "16 4 1 128 1"));

}  // namespace
}  // namespace tissue_sim
#else
TEST(FaceContactOnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
