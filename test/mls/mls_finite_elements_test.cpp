// Forces of tools on meshless tissue against finite elements (test/data/references.yaml), eight
// nodes across the contact; docs/mls.md has finer ones, and other materials beside method mpm.
#include <gtest/gtest.h>

#include <cstdio>

#include "support/finite_element_scenes.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

double force_error(const Tool& tool, double spacing, MlsPlacement placement, double depth,
                   const char* body, const char* name) {
  Scene scene = indented_cylinder(2 * spacing, 2 * spacing, tool);
  scene.method = Method::kMls;
  scene.mls.placement = placement;
  Simulation simulation(scene);
  const double error =
      indentation_force(simulation, depth) / reference(TISSUE_SIM_TEST_DATA, body, name) - 1;
  std::printf("%s, %s: %+.4f\n", body, name, error);
  return error;
}

Tool smooth(ToolType type, double radius) {
  Tool t;
  t.name = "tool";
  t.type = type;
  t.radius = radius;
  t.edge_radius = 0.001;
  t.length = 0.05;
  t.friction = 0;
  return t;
}

TEST(MlsFiniteElements, ForceOnARoundTool) {
  const Tool ball = smooth(ToolType::kBall, 0.01);
  EXPECT_TRUE(is_within(
      "ball of 10 mm, 6 mm deep, nodes of 1.5 mm",
      force_error(ball, 0.0015, MlsPlacement::kRegular, 0.006, "ball", "force_6mm"), 0.03));
  EXPECT_TRUE(
      is_within("the same, graded",
                force_error(ball, 0.0015, MlsPlacement::kGraded, 0.006, "ball", "force_6mm"), 0.1));
}

TEST(MlsFiniteElements, ForceOnAFlatTool) {
  const Tool punch = smooth(ToolType::kPunch, 0.006);
  EXPECT_TRUE(is_within(
      "flat punch of 6 mm, 3 mm deep, nodes of 1.5 mm",
      force_error(punch, 0.0015, MlsPlacement::kRegular, 0.003, "punch", "force_3mm"), 0.03));
}

}  // namespace
}  // namespace tissue_sim
