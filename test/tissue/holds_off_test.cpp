// A tool does not pass through tissue, from a cell of thickness and of tip radius on.
#include <gtest/gtest.h>

#include <algorithm>

#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class HoldsOff : public EachMethod {
 protected:
  void SetUp() override {
    EachMethod::SetUp();
    if (IsSkipped()) return;
    const bool is_gpu = GetParam().device == Device::kCuda;
    if (is_gpu && GetParam().method != Method::kMls) {
      GTEST_SKIP() << "on a GPU what is pressed that far is counted (PointsInside), not held";
    }
  }
};

/// A sheet of 60 x 60 mm held at its rim, 6 mm all round.
Scene sheet_and_probe(double thickness, double radius) {
  Scene scene;
  scene.cell_size = 0.003;
  scene.ground.enabled = false;
  scene.gravity = Vec3::Zero();
  scene.damping = 20;
  Material soft;
  soft.name = "soft";
  soft.young_modulus = 5000;
  soft.poisson_ratio = 0.45;
  scene.materials = {soft};
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.size = Vec3(0.06, 0.06, thickness);
  body.material = "soft";
  for (int side = 0; side < 4; ++side) {
    Region rim;
    rim.kind = Region::Kind::kBox;
    rim.min = Vec3::Constant(-0.031);
    rim.max = Vec3::Constant(0.031);
    (side % 2 == 0 ? rim.max : rim.min)[side / 2] = side % 2 == 0 ? -0.024 : 0.024;
    body.anchors.push_back(rim);
  }
  scene.tools.resize(1);
  scene.tools[0].radius = radius;
  return scene;
}

TEST_P(HoldsOff, AProbeDoesNotPassThroughASheet) {
  struct Case {
    double thickness, radius, speed;
    MpmBoundary boundary;
  };
  const Case cases[] = {{0.004, 0.004, 1, MpmBoundary::kLattice},
                        {0.004, 0.004, 1, MpmBoundary::kSurface},
                        {0.003, 0.003, 1, MpmBoundary::kSurface},
                        {0.006, 0.004, 0.1, MpmBoundary::kLattice}};
  for (const Case& c : cases) {
    Scene scene = on_this(sheet_and_probe(c.thickness, c.radius));
    if (scene.method != Method::kMpm && c.boundary == MpmBoundary::kSurface && c.radius > 0.003) {
      continue;  // the same as before
    }
    scene.mpm.boundary = c.boundary;
    scene.mls.spacing = 0;
    Simulation simulation(scene);
    Pose pose;
    pose.orientation = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
    const double top = c.thickness / 2, end = top - 0.024;
    double force = 0, most = 0;
    int inside = 0, held = 0;
    for (double z = top + 0.001; held < 6; z = std::max(end, z - c.speed / scene.frame_rate)) {
      pose.position = Vec3(0.0002, 0.0003, z);
      simulation.set_tool(0, pose);
      const FrameResult result = simulation.advance_frame().result;
      ASSERT_FALSE(result.blew_up);
      force = result.loads[0].mean.force.z();
      most = std::max(most, force);
      inside = result.points_inside;
      held += z <= end ? 1 : 0;
    }
    double lowest = 1;
    for (const Point& p : points_of(simulation.tissue())) lowest = std::min<double>(lowest, p.z);
    const std::string which = std::to_string(1e3 * c.thickness) + " mm, tip of " +
                              std::to_string(1e3 * c.radius) + " mm, " + std::to_string(c.speed) +
                              " m/s, boundary " + std::to_string(static_cast<int>(c.boundary));
    // What passes through is let go: a third of the force is left then, and all tissue is above.
    EXPECT_GT(force, 0.7 * most) << which;
    EXPECT_LT(lowest - end, 0.5 * c.radius) << which;
    EXPECT_EQ(inside, 0) << which;
  }
}

FOR_EACH_METHOD(HoldsOff);

}  // namespace
}  // namespace tissue_sim
