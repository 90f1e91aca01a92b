// What tissue weighs on what carries it.
#include <gtest/gtest.h>

#include <vector>

#include "support/cut_paths.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.036, 0.024, 0.018);
const double kWeight = 9.81 * 1060 * kSize.prod();  // [N]

class Weight : public EachMethod {
 protected:
  /// A box of liver, its middle above the origin, that comes to rest soon.
  Scene box_at(double bottom) const {
    Scene scene = on_this(free_box(kSize, 0.003));
    scene.bodies[0].pose.position = Vec3(0, 0, bottom + 0.5 * kSize[2]);
    scene.gravity = Vec3(0, 0, -9.81);
    scene.damping = 15;
    return scene;
  }
  void expect_carried(Simulation& simulation, const std::vector<Pose>& tips);
};
FOR_EACH_METHOD(Weight);

/// A pose whose shaft lies along y, towards -y from the tip.
Pose along_y(const Vec3& tip) { return {tip, Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitY())}; }

/// Force on all tools, and their moment about the origin: means over some frames of rest.
Wrench carried(Simulation& simulation, const std::vector<Pose>& tips) {
  constexpr int kFrames = 30;
  Wrench sum;
  for (int f = 0; f < kFrames; ++f) {
    const FrameResult r = simulation.advance_frame().result;
    for (std::size_t i = 0; i < tips.size(); ++i) {
      const Wrench& on_tool = r.loads[i].mean;
      sum.force += on_tool.force / kFrames;
      sum.torque += (tips[i].position.cross(on_tool.force) + on_tool.torque) / kFrames;
    }
  }
  return sum;
}

/// Once the body is at rest the tools feel its weight, where its middle is.
void Weight::expect_carried(Simulation& simulation, const std::vector<Pose>& tips) {
  for (int f = 0; f < 150; ++f) simulation.advance_frame();
  const Wrench felt = carried(simulation, tips);
  const Fragment piece = simulation.tissue().fragments()[0];
  ASSERT_LT(piece.velocity.norm(), 2e-4) << "it is not at rest";
  const Vec3 weight(0, 0, -kWeight);
  EXPECT_TRUE(is_at_most("weight that tools feel, off", (felt.force - weight).norm() / kWeight,
                         within().weight, "%"))
      << felt.force.transpose();
  EXPECT_TRUE(is_at_most("its moment, of m g and the length",
                         (felt.torque - piece.centroid.cross(weight)).norm() / (kWeight * kSize[0]),
                         within().moment, "%"))
      << felt.torque.transpose();
}

// Three rods that stand still under it, the rods not in the middle.
TEST_P(Weight, OfABodyOnRodsIsWhatTheRodsFeel) {
  const double radius = 0.005;
  Scene scene = box_at(radius + 1e-4);
  std::vector<Pose> rods;
  for (const double x : {-0.013, 0.003, 0.012}) {
    Tool& rod = scene.tools.emplace_back();
    rod.name = "rod" + std::to_string(rods.size());
    rod.radius = radius;
    rod.length = 0.06;
    rod.friction = 0.6;
    rods.push_back(along_y(Vec3(x, 0.03, 0)));
  }
  Simulation simulation(scene);
  for (std::size_t i = 0; i < rods.size(); ++i) simulation.set_tool(static_cast<int>(i), rods[i]);
  expect_carried(simulation, rods);
}

// Under its left half a plate, under its right half a punch, their faces up.
TEST_P(Weight, OfABodyOnAPlateAndAPunchIsWhatTheyFeel) {
  Scene scene = box_at(1e-4);
  Tool& plate = scene.tools.emplace_back();
  plate.name = "plate";
  plate.type = ToolType::kPlate;
  plate.size = Vec3(0.018, 0.03, 0.01);
  Tool& punch = scene.tools.emplace_back();
  punch.name = "punch";
  punch.type = ToolType::kPunch;
  punch.radius = 0.008;
  for (Tool& tool : scene.tools) {
    tool.edge_radius = 0.001;
    tool.length = 0.02;
    tool.friction = 0.6;
  }
  const std::vector<Pose> up = {{Vec3(-0.01, 0, 0), Quat::Identity()},
                                {Vec3(0.01, 0, 0), Quat::Identity()}};
  Simulation simulation(scene);
  for (int i = 0; i < 2; ++i) simulation.set_tool(i, up[i]);
  expect_carried(simulation, up);
}

// The same body in two halves: all of it is carried, however it is cut.
TEST_P(Weight, StaysWhenTheBodyIsCut) {
  const double radius = 0.006;
  Scene scene = box_at(radius + 1e-4);
  std::vector<Pose> rods;
  for (const double x : {-0.0135, -0.0045, 0.0045, 0.0135}) {
    Tool& rod = scene.tools.emplace_back();
    rod.name = "rod" + std::to_string(rods.size());
    rod.radius = radius;
    rod.length = 0.06;
    rod.friction = 0.6;
    rods.push_back(along_y(Vec3(x, 0.03, 0)));
  }
  Simulation simulation(scene);
  for (std::size_t i = 0; i < rods.size(); ++i) simulation.set_tool(static_cast<int>(i), rods[i]);
  for (int f = 0; f < 60; ++f) simulation.advance_frame();
  simulation.cut(plane_cut(Vec3(0.0001, 0, 0), Vec3::UnitX()));
  for (int f = 0; f < 150; ++f) simulation.advance_frame();
  ASSERT_EQ(simulation.tissue().fragments().size(), 2u);
  const Wrench felt = carried(simulation, rods);
  EXPECT_TRUE(is_at_most("weight of both halves, off",
                         (felt.force - Vec3(0, 0, -kWeight)).norm() / kWeight, within().weight,
                         "%"))
      << felt.force.transpose();
}

TEST_P(Weight, IsCarriedByTheGround) {
  Scene scene = box_at(0.0005);
  scene.ground.enabled = true;
  Simulation simulation(scene);
  for (int f = 0; f < 120; ++f) simulation.advance_frame();
  const Fragment piece = simulation.tissue().fragments()[0];
  EXPECT_NEAR(piece.velocity.norm(), 0, 1e-3);
  EXPECT_GT(piece.box.min[2], -0.25 * scene.cell_size);
  EXPECT_NEAR(piece.centroid[2], 0.5 * kSize[2], 0.001);
  EXPECT_LT(Vec3(piece.centroid[0], piece.centroid[1], 0).norm(), 1e-4) << "it wandered";
}

}  // namespace
}  // namespace tissue_sim
