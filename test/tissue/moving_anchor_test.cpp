// Anchors that move take with them what they hold, and say what pulls them.
#include <gtest/gtest.h>

#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

constexpr double kLength = 0.03, kEdge = 0.01, kYoung = 1e4;  // of what is free [m], [Pa]

/// A bar along x between two anchors, in which sound settles fast.
Scene bar() {
  Scene s;
  s.cell_size = 0.00125;
  s.gravity = Vec3::Zero();
  s.ground.enabled = false;
  s.damping = 300;
  s.materials.resize(1);
  s.materials[0].name = "bar";
  s.materials[0].young_modulus = kYoung;
  s.materials[0].poisson_ratio = 0;
  s.materials[0].density = 1000;
  s.bodies.resize(1);
  Body& body = s.bodies[0];
  body.material = "bar";
  body.size = Vec3(kLength + 0.01, kEdge, kEdge);
  for (const double x : {-0.5 * kLength - 0.005, 0.5 * kLength}) {
    Region region;
    region.kind = Region::Kind::kBox;
    region.min = Vec3(x - 1e-6, -0.02, -0.02);
    region.max = Vec3(x + 0.005 + 1e-6, 0.02, 0.02);
    body.anchors.emplace_back(region);
  }
  return s;
}

class MovingAnchors : public EachMethod {};
FOR_EACH_METHOD(MovingAnchors);

TEST_P(MovingAnchors, PullABarAsItsModulusSays) {
  Simulation simulation(on_this(bar()));
  if (!simulation.tissue().moves_anchors()) GTEST_SKIP() << "anchors do not move";
  constexpr double kStretch = 0.01;
  const double pull = kYoung * kEdge * kEdge * kStretch;
  Pose right = simulation.anchor(1);
  right.position.x() += kStretch * kLength;
  simulation.set_anchor(1, right);
  FrameResult result;
  for (int i = 0; i < 10; ++i) result = simulation.advance_frame().result;
  ASSERT_EQ(result.anchor_loads.size(), 2u);
  for (const double read : {result.anchor_loads[0].force.x(), -result.anchor_loads[1].force.x()}) {
    EXPECT_TRUE(is_within("reaction of anchors that pull a bar", read / pull - 1, 0.03));
  }
  for (const Wrench& load : result.anchor_loads) {
    EXPECT_LT(load.force.tail<2>().norm(), 0.01 * pull);
    EXPECT_LT(load.torque.norm(), 0.01 * pull * kEdge);
  }
}

TEST_P(MovingAnchors, CarryABarAroundWithoutForce) {
  Simulation simulation(on_this(bar()));
  if (!simulation.tissue().moves_anchors()) GTEST_SKIP() << "anchors do not move";
  const std::vector<Point> before = points_of(simulation.tissue());
  const Pose rest[] = {simulation.anchor(0), simulation.anchor(1)};
  Quat turn;
  Vec3 shift;
  FrameResult result;
  for (int i = 1; i <= 45; ++i) {
    const double share = std::min(1.0, i / 30.0);
    turn = Eigen::AngleAxisd(1.2 * share, Vec3(1, 2, 3).normalized());
    shift = share * Vec3(0.01, 0.02, -0.01);
    for (int a = 0; a < 2; ++a) {
      simulation.set_anchor(a, {turn * rest[a].position + shift, turn});
    }
    result = simulation.advance_frame().result;
  }
  const double unit = kYoung * kEdge * kEdge;
  for (const Wrench& load : result.anchor_loads) {
    EXPECT_TRUE(
        is_at_most("anchors that carry it around: force, of E A", load.force.norm() / unit, 1e-3));
    EXPECT_LT(load.torque.norm(), 1e-3 * unit * kEdge);
  }
  const std::vector<Point> after = points_of(simulation.tissue());
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Vec3 expected = turn * Vec3(before[i].x, before[i].y, before[i].z) + shift;
    ASSERT_NEAR((Vec3(after[i].x, after[i].y, after[i].z) - expected).norm(), 0, 1e-4) << i;
  }
}

}  // namespace
}  // namespace tissue_sim
