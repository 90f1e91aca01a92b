// The way out of tissue for a tool that is placed in it.
#include "tools/entry.h"

#include <gtest/gtest.h>

#include <vector>

namespace tissue_sim {
namespace {

/// A block of tissue 60 x 60 x 30 mm below z = 0, a point each millimetre.
std::vector<Point> block() {
  std::vector<Point> points;
  for (int x = -30; x <= 30; ++x) {
    for (int y = -30; y <= 30; ++y) {
      for (int z = -30; z <= 0; ++z) {
        Point p{};
        p.x = 0.001f * x, p.y = 0.001f * y, p.z = 0.001f * z;
        points.push_back(p);
      }
    }
  }
  return points;
}

Tool tool(ToolType type) {
  Tool t;
  t.type = type;
  return t;
}

Pose down(double z) {
  return {Vec3(0.0003, 0.0002, z), Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()))};
}

TEST(WayOut, IsNoneWhereNothingIsInTheTool) {
  const std::vector<Point> points = block();
  const Span<const Point> all(points);
  EXPECT_EQ(way_out(tool(ToolType::kProbe), down(0.001), 0, all, 0.001, 0.3), 0);
  EXPECT_EQ(way_out(tool(ToolType::kGrasper), down(0.001), 0, all, 0.001, 0.3), 0);
  EXPECT_EQ(way_out(tool(ToolType::kScalpel), down(-0.01), 0, all, 0.001, 0.3), 0) << "it cuts";
}

TEST(WayOut, IsAsLongAsTheToolIsDeep) {
  const std::vector<Point> points = block();
  const Span<const Point> all(points);
  for (const ToolType type : {ToolType::kProbe, ToolType::kGrasper}) {
    EXPECT_NEAR(way_out(tool(type), down(-0.012), 0, all, 0.001, 0.3), 0.012, 0.0011);
  }
  EXPECT_GT(way_out(tool(ToolType::kGrasper), down(-0.005), 1.5, all, 0.001, 0.3), 0) << "open";
}

TEST(WayOut, MayNotBeFound) {
  const std::vector<Point> points = block();
  EXPECT_EQ(way_out(tool(ToolType::kProbe), down(-0.02), 0, Span<const Point>(points), 0.001, 0.01),
            -1);
}

}  // namespace
}  // namespace tissue_sim
