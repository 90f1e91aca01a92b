// Force arrows can be read: outside tissue and tool, long enough, their labels beside them.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "ros/force_arrow.h"

namespace tissue_sim {
namespace {

Fragment box(const Vec3& min, const Vec3& max) {
  Fragment f;
  f.box = {min, max};
  return f;
}

/// How far a place is from the line from a to b [m].
double off(const Vec3& x, const Vec3& a, const Vec3& b) {
  const double t = std::max(0.0, std::min(1.0, (x - a).dot(b - a) / (b - a).squaredNorm()));
  return (x - a - t * (b - a)).norm();
}

TEST(ForceArrow, StandsOutsideTissueAndToolWhereverItPoints) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const std::vector<Fragment> pieces = {box(Vec3(-0.06, -0.03, 0), Vec3(0.02, 0.03, 0.04)),
                                        box(Vec3(0.01, -0.03, 0), Vec3(0.06, 0.03, 0.05))};
  for (int i = 0; i < 2000; ++i) {
    Tool tool;
    tool.type = i % 3 == 0   ? ToolType::kScalpel
                : i % 3 == 1 ? ToolType::kProbe
                             : ToolType::kGrasper;
    tool.length = 0.2;
    Pose pose;
    pose.position = Vec3(0.01 * normal(random), 0.01 * normal(random), 0.03);
    // Pointing down, within a quarter of a turn.
    pose.orientation = Quat(Eigen::AngleAxisd(0.4 * normal(random), Vec3::Random().normalized())) *
                       Quat(0, 1, 0, 0);
    const Vec3 way(normal(random), normal(random), normal(random));
    ForceArrow arrow;
    const double newtons = 0.01 + 0.2 * (i % 10);
    ASSERT_TRUE(place_force_arrow(tool, pose, newtons * way.normalized(), 0.02, pieces, arrow));
    const double length = (arrow.end - arrow.start).norm();
    EXPECT_NEAR(length, 4 * arrow.unit + 0.02 * newtons, 1e-12);
    EXPECT_GT((arrow.end - arrow.start).dot(way), 0.999 * length * way.norm()) << "its direction";
    const double half = tool.type == ToolType::kScalpel ? tool.blade_width / 2
                        : tool.type == ToolType::kProbe ? tool.radius
                                                        : tool.jaw_width / 2;
    const Vec3 middle(tool.type == ToolType::kScalpel ? -half : 0, 0, 0);
    for (double t = 0; t <= 1; t += 0.1) {
      const Vec3 x = arrow.start + t * (arrow.end - arrow.start);
      for (const Fragment& f : pieces) {
        EXPECT_TRUE((x.array() < f.box.min.array()).any() || (x.array() > f.box.max.array()).any())
            << i << ": in tissue at " << x.transpose();
      }
      const Vec3 local = pose.orientation.conjugate() * (x - pose.position) - middle;
      EXPECT_GT(local.head<2>().norm(), half + 0.99 * arrow.unit) << i << ": in the tool";
    }
    EXPECT_GT(off(arrow.label, arrow.start, arrow.end), 0.5 * arrow.text_height + arrow.unit) << i;
  }
}

TEST(ForceArrow, OfASmallForceIsLongAndOfALargerOneLonger) {
  Tool tool;
  tool.radius = 0.004;
  Pose pose;
  pose.orientation = Quat(0, 1, 0, 0);
  ForceArrow small, large, none;
  ASSERT_TRUE(place_force_arrow(tool, pose, Vec3(0, 0, 0.2), 0.02, Span<const Fragment>(), small));
  ASSERT_TRUE(place_force_arrow(tool, pose, Vec3(0, 0, 2), 0.02, Span<const Fragment>(), large));
  EXPECT_NEAR((small.end - small.start).norm(), 0.02, 1e-12);
  EXPECT_NEAR((large.end - large.start).norm(), 0.056, 1e-12);
  EXPECT_FALSE(
      place_force_arrow(tool, pose, Vec3(0, 0, 0.004), 0.02, Span<const Fragment>(), none));
}

TEST(ForceArrow, StandsOnAPlateAndBesideABall) {
  Tool tool;
  tool.type = ToolType::kPlate;
  Pose pose;
  pose.orientation = Quat(0, 1, 0, 0);
  ForceArrow arrow;
  ASSERT_TRUE(place_force_arrow(tool, pose, Vec3(0, 0, 1), 0.02, Span<const Fragment>(), arrow));
  EXPECT_GT(arrow.start.z(), tool.size.z() + 0.9 * arrow.unit);
  tool.type = ToolType::kBall;
  tool.radius = 0.012;
  ASSERT_TRUE(place_force_arrow(tool, pose, Vec3(1, 0, 0), 0.02, Span<const Fragment>(), arrow));
  EXPECT_GT(arrow.start.x(), tool.radius + 0.9 * arrow.unit);
  EXPECT_EQ(arrow.text_height, 0.01) << "not as large as the tool";
}

TEST(ForceArrow, StaysAtTheShaftWhereTissueIsHigherThanThat) {
  Tool tool;
  tool.length = 0.05;
  Pose pose;
  pose.orientation = Quat(0, 1, 0, 0);
  const std::vector<Fragment> pieces = {box(Vec3(-1, -1, -1), Vec3(1, 1, 1))};
  ForceArrow arrow;
  ASSERT_TRUE(place_force_arrow(tool, pose, Vec3(0, 0, 1), 0.02, pieces, arrow));
  EXPECT_NEAR(arrow.start.z(), 0.05, 1e-9);
}

}  // namespace
}  // namespace tissue_sim
