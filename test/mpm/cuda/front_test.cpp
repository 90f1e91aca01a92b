// The front of a cut on the GPU, one substep against brute force for the blocks and the CPU's
// kernel for the front's cells. Skipped where there is no GPU. What else holds: front_test.cpp.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <cmath>

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
  bool materials;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class FrontOnGpu : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
  }
};

/// A stroke into the body from the side, askew, that ends in a cell.
BladePath stroke() {
  BladePath path = upright_blade({Vec3(0.0175, -0.01, 0), Vec3(0.0205, 0.0157, 0)});
  for (Pose& pose : path.poses) pose.position.x() = 0.0185 + 0.1 * pose.position.y();
  return path;
}

/// Parted nodes somewhere; their places scattered by `size` [m].
void scatter_front(MpmState& s, double size) {
  std::mt19937 random(11);
  std::normal_distribution<float> normal;
  for (std::size_t i = 0; i < s.front.nodes.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      s.front.d[a][i] = static_cast<float>(size) * normal(random);
      s.front.rate[a][i] = 0.1f * normal(random);
    }
  }
}

/// Adds to what the nodes come to without it what the front's cells push in a substep; where
/// parted nodes come to, and how fast, to `d` and `rate`.
void add_front(MpmState& s, float dt, reference::Step& step, std::vector<Vec3>& d,
               std::vector<Vec3>& rate) {
  Front& front = s.front;
  for (std::size_t i = 0; i < front.cells.size(); ++i) {
    work_on_front_cell(s, static_cast<int>(i));
    for (int k = 0; k < 27; ++k) {
      const int n = front.cells[i].node[k];
      if (s.nodes.inv_mass[n] == 0) continue;
      const float* f = front.force.data() + static_cast<std::size_t>(kFrontForce) * i + 4 * k;
      const Vec3 more = Vec3(f[0], f[1], f[2]) * dt / step.mass[n];
      step.v[n] += more;
      step.u[n] += dt * more;
    }
  }
  d.clear();
  rate.clear();
  const double keep = std::exp(-s.scene.damping * dt);
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    d.emplace_back(front.d[0][i], front.d[1][i], front.d[2][i]);
    rate.push_back(keep * Vec3(front.rate[0][i], front.rate[1][i], front.rate[2][i]));
  }
  for (std::size_t j = 0; j < front.parts.size(); ++j) {
    const float* f = front.pull.data() + 4 * j;
    const int n = front.parts[j].node;
    rate[n] += Vec3(f[0], f[1], f[2]) * dt / front.nodes[n].mass;
  }
  for (std::size_t i = 0; i < d.size(); ++i) d[i] += dt * rate[i];
}

TEST_P(FrontOnGpu, OneSubstepAgreesWithTheCpusFrontAndBruteForce) {
  Scene scene = free_body(GetParam().law, GetParam().viscosity, Shape::kBox);
  if (GetParam().materials) add_inclusions(scene, true);
  CudaMpmTissue tissue(scene);
  ASSERT_GT(cut_now(tissue, stroke()).bonds_broken, 0);
  tissue.pull();
  MpmState& s = tissue.state();
  ASSERT_GT(s.front.cells.size(), 50u);
  deform(s);
  shake(s, 7, 8e-5);
  scatter_front(s, 2e-4);
  tissue.push();
  s.faces.until_search = 1e9;  // faces that are shaken into one another do not push
  const float dt = 1e-4f;
  reference::Step expected = reference::substep(s, dt);
  const reference::Step without = expected;
  std::vector<Vec3> d, rate;
  add_front(s, dt, expected, d, rate);
  const double energy = front_elastic_energy(s), kinetic = front_kinetic_energy(s.front);
  advance_by(tissue, 0, dt, {});
  const FrameResult before = tissue.finish();
  Front no_front;
  std::swap(no_front, s.front);
  tissue.push();
  advance_by(tissue, 0, dt, {});
  const FrameResult blocks = tissue.finish();
  std::swap(no_front, s.front);
  tissue.push();
  EXPECT_NEAR(before.elastic_energy - blocks.elastic_energy, energy, 1e-5 * blocks.elastic_energy);
  EXPECT_NEAR(before.kinetic_energy - blocks.kinetic_energy, kinetic, 1e-5 * kinetic);
  advance_by(tissue, 1, dt, {});
  tissue.finish();
  tissue.pull();
  double force_scale = 0, v_scale = 0, tells = 0, worst = 0;
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    force_scale = std::max(force_scale, expected.force[i].norm());
    v_scale = std::max(v_scale, expected.v[i].norm());
  }
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;
    const Vec3 v(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    const Vec3 u(s.nodes.u[0][i], s.nodes.u[1][i], s.nodes.u[2][i]);
    const double bound = 3e-7 * force_scale * dt / expected.mass[i] + 2e-7 * v_scale;
    tells = std::max(tells, (expected.v[i] - without.v[i]).norm() / bound);
    ASSERT_LT((v - expected.v[i]).norm(), bound) << "node " << i;
    ASSERT_LT((u - expected.u[i]).norm(), dt * bound + 1e-8) << "node " << i;
    worst = std::max(worst, (v - expected.v[i]).norm() / bound);
  }
  for (std::size_t i = 0; i < d.size(); ++i) {
    const double bound = 3e-7 * force_scale * dt / s.front.nodes[i].mass + 2e-7 * v_scale;
    const Vec3 now(s.front.d[0][i], s.front.d[1][i], s.front.d[2][i]);
    const Vec3 rate_now(s.front.rate[0][i], s.front.rate[1][i], s.front.rate[2][i]);
    ASSERT_LT((rate_now - rate[i]).norm(), bound) << "parted node " << i;
    ASSERT_LT((now - d[i]).norm(), dt * bound + 1e-8) << "parted node " << i;
    worst = std::max(worst, (rate_now - rate[i]).norm() / bound);
  }
  EXPECT_GT(tells, 100) << "the front must push much more than what may be off";
  std::printf("%zu cells, %zu parted nodes; off by %.2f of what may be, without them by %.0f\n",
              s.front.cells.size(), d.size(), worst, tells);
}

INSTANTIATE_TEST_SUITE_P(All, FrontOnGpu,
                         testing::Values(Case{"corotated", Law::kFixedCorotated, 0, false},
                                         Case{"neo-Hookean", Law::kNeoHookean, 0, false},
                                         Case{"viscous", Law::kNeoHookean, 2, false},
                                         Case{"materials", Law::kFixedCorotated, 2, true}));

}  // namespace
}  // namespace tissue_sim
#endif
