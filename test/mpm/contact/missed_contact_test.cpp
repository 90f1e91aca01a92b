// Tissue that gets going within a frame and comes to an instrument that it was not near when the
// frame began. On the CPU and, where there is one, on the GPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.002, kLong = 0.04, kWide = 0.02;  // [m]
constexpr double kHeld = 1.5 * kCell;                        // of it, at one end [m]
constexpr double kPressed = 0.3;                             // the rest by this share of its length
constexpr double kRadius = 0.003, kGap = 3.5 * kCell;        // of the probe, and before it [m]

/// A block that is held at one end, and a probe across the way of the other.
template <class T>
class MissedContactOf : public OnEitherDevice<T> {
 protected:
  MissedContactOf() {
    scene_ = free_box(Vec3(kLong, kWide, kWide), kCell);
    Region held;
    held.kind = Region::Kind::kBox;
    held.min = Vec3(-1, -1, -1);
    held.max = Vec3(kHeld, 1, 1);
    scene_.bodies[0].anchors = {held};
    scene_.tools.resize(1);
    scene_.tools[0].name = "probe";
    scene_.tools[0].radius = kRadius;
    tools_.resize(1);
    tools_[0].present = true;
    tools_[0].begin.position =
        Vec3(kLong - kPressed * (kLong - kHeld) + kGap + kRadius, kWide / 2, -0.01);
    tools_[0].begin.orientation = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3(0, 0, -1));
    tools_[0].end = tools_[0].begin;
  }
  /// Let go, pressed and at rest.
  static void press(T& tissue) {
    pull(tissue);
    MpmState& s = tissue.state();
    s.bodies[0].for_each_node([&](int node, int x, int y, int z) {
      // Nothing where it is held: the face of an anchor would keep that.
      const double free = std::max(0.0, s.bodies[0].node_position(x, y, z)[0] - kHeld);
      if (s.nodes.inv_mass[node] != 0) s.nodes.u[0][node] = static_cast<float>(-kPressed * free);
    });
    push(tissue);
  }
  /// How deep the deepest point is in the probe [m].
  double depth(T& tissue) const {
    std::vector<std::uint8_t> cloud;
    const int count = tissue.read_points({}, cloud);
    const auto* points = reinterpret_cast<const Point*>(cloud.data());
    const Vec3& axis = tools_[0].begin.position;
    double nearest = 1;
    for (int i = 0; i < count; ++i) {
      nearest = std::min(nearest, std::hypot(points[i].x - axis[0], points[i].y - axis[1]));
    }
    return kRadius - nearest;
  }

  Scene scene_;
  std::vector<ToolMotion> tools_;
};
TYPED_TEST_SUITE(MissedContactOf, Tissues, DeviceName);

TYPED_TEST(MissedContactOf, TissueLetGoIsStoppedInTheSameFrame) {
  TypeParam tissue(this->scene_), in_short_frames(this->scene_);
  this->press(tissue);
  this->press(in_short_frames);
  ASSERT_LT(this->depth(tissue), -0.9 * kGap);
  constexpr int kShort = 32;
  for (int frame = 0; frame < 3; ++frame) {
    tissue.advance(kFrame, {this->tools_, {}});
    const FrameResult result = tissue.finish();
    ASSERT_FALSE(result.blew_up);
    Vec3 expected = Vec3::Zero();
    for (int i = 0; i < kShort; ++i) {
      in_short_frames.advance(kFrame / kShort, {this->tools_, {}});
      expected += in_short_frames.finish().loads[0].mean.force / kShort;
    }
    const Vec3 force = result.loads[0].mean.force;
    const double depth = this->depth(tissue), other_depth = this->depth(in_short_frames);
    std::printf("%.4f N, %.4f in short frames; %.3f and %.3f mm deep\n", force.norm(),
                expected.norm(), 1e3 * depth, 1e3 * other_depth);
    EXPECT_GT(expected.norm(), 0.01);
    EXPECT_TRUE(is_at_most("tissue comes to a probe within a frame: force off",
                           (force - expected).norm() / std::max(expected.norm(), 0.2), 0.02, "%"));
    EXPECT_NEAR(depth, other_depth, 0.05 * kCell);
  }
}

}  // namespace
}  // namespace tissue_sim
