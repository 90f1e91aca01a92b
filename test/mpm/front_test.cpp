// The front of a cut: it ends where the blade's edge ended, wherever that lies in a cell
// (mpm: {boundary: surface}, on a CPU). Its compliance: EdgeCrack.
#include <gtest/gtest.h>

#include <algorithm>

#include "cut_scenes.h"
#include "finite_element_scenes.h"
#include "momentum.h"

namespace tissue_sim {
namespace {

/// A block of 40 x 32 x 24 mm in space, and a stroke into it from the side, askew.
Scene block(Law law, double viscosity) {
  Scene scene = free_box(Vec3(0.04, 0.032, 0.024), 0.004);
  scene.device = Device::kCpu;
  scene.mpm.boundary = MpmBoundary::kSurface;
  Material m;
  m.name = "test";
  m.law = law;
  m.viscosity = viscosity;
  scene.materials = {m};
  scene.bodies[0].material = "test";
  return scene;
}

BladePath stroke(double from, double to) {
  BladePath path = upright_blade({Vec3(0.0185, from, 0), Vec3(0.0225, to, 0)});
  for (Pose& pose : path.poses) pose.position.x() = 0.0185 + 0.1 * pose.position.y();
  return path;
}

double share_sum(const MpmState& s) {
  double sum = 0;
  for (const FrontNode& n : s.front.nodes) sum += n.share;
  return sum;
}

TEST(Front, IsTheSameHoweverSlowlyABladeCame) {
  MpmTissue fast(block(Law::kNeoHookean, 0)), slow(block(Law::kNeoHookean, 0));
  cut_now(fast, stroke(-0.01, 0.0173));
  constexpr int kStrokes = 23;
  for (int i = 0; i < kStrokes; ++i) {
    const double length = 0.0273 / kStrokes;
    cut_now(slow, stroke(-0.01 + i * length, -0.01 + (i + 1) * length));
  }
  const Front &a = fast.state().front, &b = slow.state().front;
  ASSERT_GT(a.nodes.size(), 10u);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t i = 0; i < a.nodes.size(); ++i) {
    const FrontNode &x = a.nodes[i], &y = b.nodes[i];
    EXPECT_EQ(std::make_tuple(x.body, x.x, x.y, x.z), std::make_tuple(y.body, y.x, y.y, y.z));
    EXPECT_NEAR(x.share, y.share, 0.01) << x.x << ' ' << x.y << ' ' << x.z;
    EXPECT_EQ(x.first_side, y.first_side);
  }
}

TEST(Front, IsNoneOfACutThatGoesThrough) {
  MpmTissue tissue(block(Law::kNeoHookean, 0));
  cut_now(tissue, stroke(-0.01, 0.0173));
  EXPECT_GT(tissue.state().front.cells.size(), 0u);
  cut_now(tissue, stroke(0.0173, 0.05));
  EXPECT_EQ(tissue.state().front.cells.size(), 0u);
  EXPECT_EQ(tissue.fragment_count(), 2);
}

TEST(Front, OnlyGoesOn) {
  MpmTissue tissue(block(Law::kNeoHookean, 0));
  double before = 0, y = -0.01;
  for (double to = 0.011; to < 0.0131; to += 0.0003) {  // within half a cell
    cut_now(tissue, stroke(y, to));
    y = to;
    const double now = share_sum(tissue.state());
    EXPECT_GE(now, before);
    before = now;
  }
  const auto bonds = tissue.state().points.bonds;
  cut_now(tissue, stroke(-0.01, 0.012));  // again, less deep
  EXPECT_EQ(share_sum(tissue.state()), before);
  EXPECT_EQ(tissue.state().points.bonds, bonds);
}

/// Flies and spins with a front that opens: momentum stays, energy does.
void flies(Law law) {
  MpmTissue tissue(block(law, 0));
  MpmState& s = tissue.state();
  cut_now(tissue, stroke(-0.01, 0.0173));
  const std::vector<Vec3> home = homes(s);
  const Vec3 center(0.02, 0.016, 0.012);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 X = home[i] - center;
    const Vec3 opening(X.x() > 0 ? 8 * (0.016 - X.y()) : -8 * (0.016 - X.y()), 0, 0);
    const Vec3 v = Vec3(0.1, -0.06, 0.08) + Vec3(3, 5, -4).cross(X) + opening;
    for (int c = 0; c < 3; ++c) s.nodes.v[c][i] = static_cast<float>(v[c]);
  }
  const Momentum before = tissue.momentum();
  const float dt = 0.3f * tissue.stable_substep();
  tissue.advance(1, dt, {});
  const FrameResult first = tissue.finish();
  const double energy = first.kinetic_energy + first.elastic_energy;
  double opened = 0, least = energy, most = energy;
  for (int i = 0; i < 20; ++i) {
    if (i == 10) cut_now(tissue, stroke(0.0173, 0.0212));  // nodes part for good on the way
    tissue.advance(100, dt, {});
    const FrameResult r = tissue.finish();
    if (i < 4) least = std::min(least, r.kinetic_energy + r.elastic_energy);  // later faces touch
    most = std::max(most, r.kinetic_energy + r.elastic_energy);
    for (const float d : s.front.d[0]) opened = std::max<double>(opened, std::fabs(d));
  }
  const Momentum after = tissue.momentum();
  EXPECT_GT(opened, 1e-4);
  EXPECT_LT((after.linear - before.linear).norm(), 3e-5 * before.linear.norm());
  EXPECT_LT((after.angular - before.angular).norm(), 3e-5 * before.angular.norm());
  EXPECT_LT(most, 1.003 * energy);
  EXPECT_GT(least, 0.997 * energy);
}
TEST(Front, KeepsMomentumAndEnergyNeoHookean) { flies(Law::kNeoHookean); }
TEST(Front, KeepsMomentumAndEnergyCorotated) { flies(Law::kFixedCorotated); }

TEST(Front, SameBitsOnAnyNumberOfThreadsAndAfterItWasSaved) {
  std::uint64_t sums[3];
  for (int run = 0; run < 3; ++run) {
    Scene scene = block(Law::kFixedCorotated, 0.5);
    scene.gravity = Vec3(3, 0, -9.81);
    scene.bodies[0].anchors = {beyond(1, 0.03, true)};
    scene.threads = run == 0 ? 1 : 2;
    auto tissue = std::make_unique<MpmTissue>(scene);
    const BladePath path = stroke(-0.01, 0.0173);
    tissue->advance(1.0 / 60, {{}, {&path, 1}});
    tissue->finish();
    if (run == 2) {
      const std::vector<std::uint8_t> saved = tissue->save();
      tissue = std::make_unique<MpmTissue>(scene);
      tissue->restore(saved);
    }
    ASSERT_GT(tissue->state().front.cells.size(), 0u);
    for (int i = 0; i < 3; ++i) {
      tissue->advance(1.0 / 60, {});
      EXPECT_FALSE(tissue->finish().blew_up);
    }
    sums[run] = tissue->checksum();
  }
  EXPECT_EQ(sums[0], sums[1]);
  EXPECT_EQ(sums[0], sums[2]);
}

}  // namespace
}  // namespace tissue_sim
