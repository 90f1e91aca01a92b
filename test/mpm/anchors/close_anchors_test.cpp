// Anchors over one another, or so close that more rows of nodes at their faces have nodes in common
// than are held together; and what is seen of what they hold.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "mpm/mpm_tissue.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.001;

/// A slab that hangs on 16 balls of little more than a cell, three cells apart.
Scene hung_on_balls() {
  Scene scene;
  scene.cell_size = kCell;
  scene.ground.enabled = false;
  scene.gravity = Vec3(5, 0, -9.81);
  scene.damping = 50;
  scene.materials.resize(1);
  scene.materials[0].name = "slab";
  scene.materials[0].young_modulus = 5000;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.material = "slab";
  body.size = kCell * Vec3(16, 16, 6);
  body.pose.position = 0.5 * body.size;
  for (int i = 0; i < 16; ++i) {
    Region ball;
    ball.kind = Region::Kind::kBall;
    ball.center = kCell * Vec3(3.13 + 3 * (i % 4), 3.27 + 3 * (i / 4), 3.4);
    ball.radius = 1.3 * kCell;
    body.anchors.emplace_back(ball);
  }
  return scene;
}

TEST(CloseAnchors, HoldAtAllOfTheirFaces) {
  MpmTissue tissue(hung_on_balls());
  const AnchorFaces& faces = tissue.state().anchors;
  std::size_t rows = 0;
  for (const FaceGroup& g : faces.groups) {
    EXPECT_LE(g.count, kLargestGroup);
    rows += g.count;
  }
  EXPECT_EQ(rows, faces.rows.size());
  ASSERT_GT(rows, 2u * kLargestGroup);
  std::set<std::tuple<float, float, float>> held;
  for (const FaceRow& r : faces.rows) held.emplace(r.place[0], r.place[1], r.place[2]);
  for (const FaceLink& l : faces.links) {
    EXPECT_EQ(held.count({l.place[0], l.place[1], l.place[2]}), 1u)
        << l.place[0] << " " << l.place[1] << " " << l.place[2];
  }
}

TEST(CloseAnchors, KeepTissueAtTheirFacesWhereItIs) {
  MpmTissue tissue(hung_on_balls());
  const float dt = tissue.substep_for({});
  for (int i = 0; i < 5; ++i) {
    advance_by(tissue, 100, dt, {});
    ASSERT_FALSE(tissue.finish().blew_up);
  }
  const MpmState& s = tissue.state();
  const auto length = [&s](int node) {
    return std::hypot(s.nodes.u[0][node], s.nodes.u[1][node], s.nodes.u[2][node]);
  };
  double farthest = 0;
  for (int i = 0; i < static_cast<int>(s.nodes.size()); ++i) {
    farthest = std::max<double>(farthest, length(i));
  }
  EXPECT_GT(farthest, 0.1 * kCell);
  for (const FaceLink& l : s.anchors.links) {
    const double x = l.at;
    const double weight[] = {0.5 * (0.5 - x) * (0.5 - x), 0.75 - x * x,
                             0.5 * (0.5 + x) * (0.5 + x)};
    Vec3 u = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      int n[] = {l.cell[0], l.cell[1], l.cell[2]};
      n[l.axis] += l.outside ? k - 1 : 1 - k;
      const int node = s.bodies[l.body].node(n[0], n[1], n[2]);
      for (int a = 0; a < 3; ++a) u[a] += weight[k] * s.nodes.u[a][node];
    }
    EXPECT_LT(u.norm(), 0.03 * kCell) << l.place[0] << " " << l.place[1] << " " << l.place[2];
  }
}

/// Points that an anchor has of a cell at its face keep some stiffness there, which nobody sees.
TEST(CloseAnchors, ShowWhatTheyHoldWithoutStress) {
  MpmTissue tissue(hung_on_balls());
  advance_by(tissue, 100, tissue.substep_for({}), {});
  ASSERT_FALSE(tissue.finish().blew_up);
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  const Points& points = tissue.state().points;
  ASSERT_EQ(count, points.size());
  int held = 0, stressed = 0;
  for (int i = 0; i < count; ++i) {
    Point point;
    std::memcpy(&point, &cloud[i * sizeof(Point)], sizeof(Point));
    if (points.free_volume_of(point.id) > 0) {
      stressed += point.stress > 0 ? 1 : 0;
      continue;
    }
    ++held;
    EXPECT_EQ(point.stress, 0) << point.id;
  }
  EXPECT_GT(held, 100);
  EXPECT_GT(stressed, count / 2);
}

/// A plane, a ball and a box that overlap anywhere, and move: rounding once left nodes of 1e-24 kg
/// beside points with stiffness, which blew up at any substep.
TEST(CloseAnchors, MoveTissueWhereTheyOverlap) {
  std::mt19937 random(2);
  const auto number = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto between = [&number](const Vec3& low, const Vec3& high) {
    Vec3 x;
    for (int a = 0; a < 3; ++a) x[a] = number(low[a], high[a]);
    return x;
  };
  for (int trial = 0; trial < 8; ++trial) {
    Scene scene = hung_on_balls();
    scene.cell_size = 0.0021;
    Body& body = scene.bodies[0];
    body.size = Vec3(0.024, 0.02, 0.016);
    body.pose.position = 0.5 * body.size;
    body.anchors.clear();
    Region plane, ball, box;
    plane.z = number(0.001, 0.005);
    ball.kind = Region::Kind::kBall;
    ball.center = between(Vec3(0, 0, 0.01), body.size);
    ball.radius = number(0.003, 0.006);
    box.kind = Region::Kind::kBox;
    box.min = between(Vec3::Constant(-0.002), 0.6 * body.size);
    box.max = box.min + between(Vec3::Constant(0.004), 0.6 * body.size);
    std::vector<AnchorMotion> motion;
    for (const Region& r : {plane, ball, box}) {
      body.anchors.emplace_back(r);
      AnchorMotion m;
      m.begin.position = body.anchors.back().origin();
      m.end = {m.begin.position + between(Vec3::Constant(-2e-4), Vec3::Constant(2e-4)),
               Quat(Eigen::AngleAxisd(0.02, Vec3(1, trial, 2).normalized()))};
      motion.push_back(m);
    }
    FrameInput input;
    input.anchors = motion;
    MpmTissue tissue(scene);
    advance_by(tissue, 40, 5e-5f, input);
    const FrameResult result = tissue.finish();
    EXPECT_FALSE(result.blew_up) << trial;
    EXPECT_LT(result.max_speed, 3) << trial;
    EXPECT_GT(result.max_speed, 0.01) << trial;
  }
}

}  // namespace
}  // namespace tissue_sim
