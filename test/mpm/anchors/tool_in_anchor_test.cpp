// Tools that come into an anchor, where nothing gives way.
#include <gtest/gtest.h>

#include <algorithm>

#include "mpm/mpm_tissue.h"
#include "mpm/tear/debris.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

constexpr double kFace = 0.0091;  // [m]

/// A block that is held up to a plane amid a cell, and a probe.
Scene held_block_and_probe() {
  Scene scene;
  scene.method = Method::kMpm;
  scene.device = Device::kCpu;
  scene.threads = 1;
  scene.cell_size = 0.0033;
  scene.ground.enabled = false;
  scene.damping = 3;
  scene.materials.resize(1);
  scene.materials[0].name = "gel";
  scene.materials[0].law = Law::kNeoHookean;
  scene.materials[0].young_modulus = 12000;
  scene.materials[0].poisson_ratio = 0.3;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.material = "gel";
  body.size = Vec3(0.030, 0.035, 0.028);
  body.pose.position = 0.5 * body.size;
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, -1);
  held.max = Vec3(kFace, 1, 1);
  body.anchors.emplace_back(held);
  scene.tools.resize(1);
  scene.tools[0].name = "probe";
  scene.tools[0].radius = 0.0057;
  return scene;
}

/// The least det F of the points that move.
double least_volume(MpmState& s) {
  double least = 1;
  for (int p = 0; p < s.points.size(); ++p) {
    if (!(s.points.free_volume_of(p) > 0)) continue;
    const Points::Site& site = s.points.site[p];
    least = std::min(
        least, deformation_gradient(s.bodies[site.body], site, *s.fields, s.nodes).determinant());
  }
  return least;
}

// Stiff springs pressed what the face holds until it was inside out (-0.06).
TEST(ToolInAnchor, TurnsNothingInsideOut) {
  Simulation simulation(held_block_and_probe());
  auto& tissue = dynamic_cast<MpmTissue&>(simulation.tissue());
  Pose pose;
  pose.orientation = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  double least = 1;
  for (int f = 0; f < 60; ++f) {
    // Down along the face, half of the probe within the anchor.
    pose.position = Vec3(kFace, 0.0175, 0.0285 - 0.010 * f / 60);
    simulation.set_tool(0, pose);
    ASSERT_FALSE(simulation.advance_frame().result.blew_up);
    least = std::min(least, least_volume(tissue.state()));
  }
  EXPECT_GT(least, 0.15);
}

}  // namespace
}  // namespace tissue_sim
