// A state that was saved goes on with the same bits in another simulation; what is no such state is
// refused with the reason.
#include <gtest/gtest.h>

#include <functional>

#include "test_scenes.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

using Bytes = std::vector<std::uint8_t>;

Span<const std::uint8_t> view(const Bytes& bytes) { return {bytes.data(), bytes.size()}; }

class SavedState : public EachMethod {
 protected:
  /// Liver that a scalpel cuts through, a probe pushes and a grasper pinches; and a ball that
  /// falls.
  Scene operation() const {
    Scene s = on_this(operation_scene(Vec3(0.08, 0.048, 0.028), Vec3(0, 0, 0.015)));
    Tool grasper;
    grasper.name = "grasper";
    grasper.type = ToolType::kGrasper;
    s.tools.push_back(grasper);
    Body ball;
    ball.name = "ball";
    ball.shape = Shape::kBall;
    ball.radius = 0.01;
    ball.pose.position = Vec3(-0.01, 0, 0.042);
    s.bodies.push_back(ball);
    return s;
  }
  static void frame(Simulation& simulation) {
    const auto i = static_cast<double>(simulation.frame());
    const double t = i / 24;
    const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
    simulation.set_tool(0, {Vec3(0.002 + 0.01 * t, 0.05 - 0.13 * t, -0.001), down});
    simulation.set_tool(1, {Vec3(0.03, -0.01, 0.036 - 0.012 * t), down});
    simulation.set_tool(2, {Vec3(-0.03, 0, 0.022), down}, 0.8 - 0.05 * i);
    if (simulation.frame() == 12) {
      BladePath path;
      path.edge = {Vec3(-0.02, -0.1, 0), Vec3(-0.02, 0.1, 0)};
      path.poses.resize(2);
      path.poses[0].position.z() = -0.01;
      path.poses[1].position.z() = 0.05;
      simulation.cut(path);
    }
    simulation.advance_frame();
  }
  /// Empty where this method cannot be saved yet.
  static Bytes save(Simulation& simulation) {
    try {
      return simulation.save();
    } catch (const std::runtime_error& e) {
      if (std::string(e.what()).find("cannot be saved yet") == std::string::npos) throw;
      return {};
    }
  }
  void expect_refused(const Scene& scene, const Bytes& bytes, const std::string& reason) {
    Simulation simulation(scene);
    try {
      simulation.restore(view(bytes));
      ADD_FAILURE() << "was restored: " << reason;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find(reason), std::string::npos) << e.what();
    }
  }
};
FOR_EACH_METHOD(SavedState);

TEST_P(SavedState, GoesOnWithTheSameBits) {
  Simulation whole(operation());
  std::vector<Bytes> saved;
  std::vector<std::uint64_t> checksums;
  for (int i = 0; i < 30; ++i) {
    if (i % 6 == 0) saved.push_back(save(whole));
    if (saved.back().empty()) GTEST_SKIP() << "states of this method cannot be saved yet";
    frame(whole);
    checksums.push_back(whole.tissue().checksum());
  }
  EXPECT_GT(whole.tissue().fragment_count(), 2);
  for (const Bytes& bytes : saved) {  // before the first frame, while it is cut, after
    Simulation again(operation());
    again.restore(view(bytes));
    const std::int64_t begun = again.frame();
    if (begun > 0) {
      EXPECT_EQ(again.tissue().checksum(), checksums[begun - 1]);
    }
    while (again.frame() < 30) {
      frame(again);
      ASSERT_EQ(again.tissue().checksum(), checksums[again.frame() - 1])
          << "frame " << again.frame() << ", from " << begun;
    }
    EXPECT_EQ(again.tissue().fragment_count(), whole.tissue().fragment_count());
    EXPECT_EQ(again.time(), whole.time());
    for (std::size_t i = 0; i < whole.tissue().fragments().size(); ++i) {
      EXPECT_EQ(again.tissue().fragments()[i].centroid, whole.tissue().fragments()[i].centroid);
      EXPECT_EQ(again.tissue().fragments()[i].parent, whole.tissue().fragments()[i].parent);
    }
  }
}

TEST_P(SavedState, WhatIsNoSuchStateIsRefusedWithTheReason) {
  Simulation simulation(operation());
  frame(simulation);
  const Bytes whole = save(simulation);
  if (whole.empty()) GTEST_SKIP() << "states of this method cannot be saved yet";
  for (const std::size_t size :
       {std::size_t(20), std::size_t(100), whole.size() / 2, whole.size() - 1}) {
    expect_refused(operation(), Bytes(whole.begin(), whole.begin() + size), "cut short");
  }
  expect_refused(operation(), {}, "no state");
  expect_refused(operation(), Bytes(5000, 7), "no state");
  Bytes changed = whole;
  changed[whole.size() / 2] ^= 1;
  expect_refused(operation(), changed, "damaged");
  changed = whole;
  changed.push_back(0);
  expect_refused(operation(), changed, "damaged");
  changed = whole;
  ++changed[16];
  expect_refused(operation(), changed, "version");
  Scene other = operation();
  other.gravity.z() = -1.62;
  expect_refused(other, whole, "another scene, whose");
  expect_refused(other, whole, "gravity");
  other = operation();
  other.threads = 1;
  Simulation same(other);
  same.restore(view(whole));
  EXPECT_EQ(same.frame(), 1);
  EXPECT_THROW(same.restore(view(whole)), std::runtime_error) << "has advanced";
}

}  // namespace
}  // namespace tissue_sim
