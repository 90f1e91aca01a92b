// Points of tissue that lie in a tool are counted and said, those that touch it are not.
#include "tools/points_inside.h"

#include <gtest/gtest.h>

#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class PointsInside : public EachMethod {};

/// A block on the ground and a probe that goes down into it, tip first.
Scene block_and_probe(double radius) {
  Scene scene;
  scene.cell_size = 0.003;
  scene.gravity = Vec3::Zero();
  scene.damping = 20;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.036, 0.036, 0.024);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.012);
  Material soft;
  soft.name = "soft";
  soft.young_modulus = 5000;
  scene.materials = {soft};
  scene.bodies[0].material = "soft";
  Tool probe;
  probe.name = "poker";
  probe.radius = radius;
  scene.tools = {probe};
  return scene;
}

FrameResult press(const Scene& scene, double depth, double speed) {
  Simulation simulation(scene);
  Pose pose;
  pose.orientation = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  FrameResult result;
  for (double z = 0.025; z > 0.024 - depth; z -= speed / scene.frame_rate) {
    pose.position = Vec3(0.0002, 0.0003, z);
    simulation.set_tool(0, pose);
    result = simulation.advance_frame().result;
  }
  return result;
}

TEST_P(PointsInside, ATouchIsNone) {
  const Scene scene = on_this(block_and_probe(0.006));
  const FrameResult result = press(scene, 0.003, 0.05);
  EXPECT_GT(result.loads[0].mean.force.norm(), 0);
  EXPECT_EQ(result.points_inside, 0);
  EXPECT_EQ(result.inside_depth, 0);
  EXPECT_EQ(inside_warning(scene, result), "");
}

TEST_P(PointsInside, ATipThinnerThanACellHasNoneEither) {
  const Scene scene = on_this(block_and_probe(0.002));
  const FrameResult result = press(scene, 0.018, 0.3);
  EXPECT_GT(result.loads[0].mean.force.norm(), 0);
  EXPECT_EQ(result.points_inside, 0);
}

TEST_P(PointsInside, AreSaidWithTheCellsThatWouldHold) {
  const Scene scene = on_this(block_and_probe(0.002));
  FrameResult result;
  result.loads.resize(1);
  result.loads[0].points_inside = 2;
  result.loads[0].inside_depth = 0.001;
  sum_inside(result);
  EXPECT_EQ(result.points_inside, 2);
  EXPECT_EQ(result.inside_depth, 0.001);
  const std::string said = inside_warning(scene, result);
  EXPECT_NE(said.find("'poker'"), std::string::npos) << said;
  EXPECT_NE(said.find("cell_size 0.002 would hold"), std::string::npos) << said;
}

TEST_P(PointsInside, ATipBetweenPointsIsSaid) {
  const Scene scene = on_this(block_and_probe(0.0009));
  FrameResult result;
  result.loads.resize(1);
  EXPECT_EQ(inside_warning(scene, result), "");
  result.loads[0].mean.force.z() = 0.01;
  const std::string said = inside_warning(scene, result);
  EXPECT_NE(said.find("'poker'"), std::string::npos) << said;
  EXPECT_NE(said.find("cell_size 0.0009 would hold"), std::string::npos) << said;
  EXPECT_EQ(inside_warning(on_this(block_and_probe(0.0011)), result), "");
}

FOR_EACH_METHOD(PointsInside);

}  // namespace
}  // namespace tissue_sim
