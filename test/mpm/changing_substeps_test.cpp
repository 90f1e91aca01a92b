// What holds while substeps change in length: tissue that swings widely stiffens and softens many
// times a second, and its substeps follow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"
#include "support/stability_limit.h"

namespace tissue_sim {
namespace {

template <class T>
class ChangingSubsteps : public OnEitherDevice<T> {};
TYPED_TEST_SUITE(ChangingSubsteps, Tissues, DeviceName);

/// A free block, twisted and bent at `speed` [m/s].
template <class T>
void swing(T& tissue, double speed) {
  pull(tissue);
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 x = home[i] / 0.01;
    const Vec3 v = speed * Vec3(std::sin(1.7 * x[1]) * std::cos(x[2]), -std::sin(1.3 * x[2]),
                                std::sin(2.1 * x[0]));
    for (int a = 0; a < 3; ++a) s.nodes.v[a][i] = static_cast<float>(v[a]);
  }
  push(tissue);
}

Scene elastic_block(Law law) {
  Scene scene = soft_body(0.45, Vec3(10, 8, 6), law);
  scene.damping = scene.materials[0].viscosity = 0;
  return scene;
}

template <class T>
FrameResult next_frame(T& tissue) {
  tissue.advance(kFrame, {});
  return tissue.finish();
}

double energy(const FrameResult& r) { return r.kinetic_energy + r.elastic_energy; }

TYPED_TEST(ChangingSubsteps, GiveNoEnergy) {
  for (const Law law : {Law::kNeoHookean, Law::kFixedCorotated}) {
    TypeParam tissue(elastic_block(law));
    swing(tissue, 2);
    double start = 0, most = 0, shortest = 1, longest = 0;
    for (int frame = 0; frame < 90; ++frame) {
      const FrameResult r = next_frame(tissue);
      if (frame == 0) start = energy(r);
      most = std::max(most, energy(r));
      shortest = std::min(shortest, r.substep);
      longest = std::max(longest, r.substep);
    }
    std::printf("energy at most %.4f of what it was; substeps of %.0f to %.0f us\n", most / start,
                1e6 * shortest, 1e6 * longest);
    EXPECT_TRUE(is_at_most("energy of a free block that swings wildly, 1.5 s", most / start, 1.03));
    EXPECT_GT(longest, 1.5 * shortest);
  }
}

/// What swings less wildly goes on for longer: each second's mean beside the first's.
TYPED_TEST(ChangingSubsteps, GiveNoEnergyInTheLongRun) {
  for (const Law law : {Law::kNeoHookean, Law::kFixedCorotated}) {
    TypeParam tissue(elastic_block(law));
    swing(tissue, 1);
    std::vector<double> means(8, 0.0);
    for (double& mean : means) {
      for (int frame = 0; frame < 60; ++frame) mean += energy(next_frame(tissue)) / 60;
    }
    const double growth = means.back() / means.front();
    std::printf("after %zu s the energy is %.4f of what it was\n", means.size() - 1, growth);
    EXPECT_TRUE(is_at_most("the same at half the speed, 8 s", growth, 1.004));
    EXPECT_GT(growth, 0.99);
  }
}

TYPED_TEST(ChangingSubsteps, LeaveWhatToolsReportExact) {
  Scene scene = soft_body(0.45, Vec3(8, 8, 8));
  scene.tools.resize(1);
  scene.tools[0].radius = 0.003;
  TypeParam tissue(scene);
  const float longest = 0.7f * tissue.stable_substep();
  Vec3 given = Vec3::Zero();
  for (int frame = 0; frame < 8; ++frame) {
    ToolMotion m;
    m.present = true;
    const double z = 0.01 - 0.0005 * frame;
    m.begin.position = Vec3(0.001, 0, z);
    m.end.position = Vec3(0.001, 0, z - 0.0005);
    const int substeps = 20;
    const float dt = frame % 2 == 0 ? longest : 0.4f * longest;
    advance_by(tissue, substeps, dt, {{&m, 1}, {}});
    given -= substeps * static_cast<double>(dt) * tissue.finish().loads[0].mean.force;
  }
  pull(tissue);
  const Vec3 gained = momentum(tissue.state()).linear;
  EXPECT_GT(gained.norm(), 1e-4);
  EXPECT_TRUE(is_at_most("a probe's impulse while substeps change",
                         (gained - given).norm() / gained.norm(), 3e-5));
}

}  // namespace
}  // namespace tissue_sim
