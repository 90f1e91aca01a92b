// Pieces that touch: they rest on one another, slide with friction, and give one another what they
// lose of momentum.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "pbd/find_touches.h"
#include "pbd/pbd_tissue.h"
#include "pbd/touch.h"
#include "tissue_sim/simulation.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#endif

namespace tissue_sim {
namespace {

struct Case {
  PbdModel model;
  Device device;
};

class Touches : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (GetParam().device == Device::kCpu) return;
#if defined(TISSUE_SIM_CUDA)
    if (!why_no_gpu().empty()) GTEST_SKIP() << why_no_gpu();
#else
    GTEST_SKIP() << "built without CUDA";
#endif
  }
  /// A flat box, held fast, and a smaller one above it.
  Scene two_boxes(double friction, double above) const {
    Scene scene;
    scene.method = Method::kPbd;
    scene.device = GetParam().device;
    scene.pbd.model = GetParam().model;
    scene.cell_size = 0.005;
    scene.ground.enabled = false;
    Material m;
    m.name = "rubber";
    m.young_modulus = 3e4;
    m.poisson_ratio = 0.3;
    m.density = 1000;
    m.friction = friction;
    scene.materials = {m};
    scene.bodies.resize(2);
    for (Body& b : scene.bodies) b.material = m.name;
    scene.bodies[0].name = "below";
    scene.bodies[0].size = Vec3(0.09, 0.05, 0.01);
    scene.bodies[0].anchors.resize(1);
    scene.bodies[0].anchors[0].kind = Region::Kind::kBox;
    scene.bodies[0].anchors[0].min = Vec3(-1, -1, -1);
    scene.bodies[0].anchors[0].max = Vec3(1, 1, 0.0051);
    scene.bodies[1].name = "above";
    scene.bodies[1].size = Vec3(0.021, 0.023, 0.012);
    scene.bodies[1].pose.position = Vec3(0, 0, 0.005 + 0.006 + above);
    return scene;
  }
};

/// Mean place and velocity of a body, and its lowest vertex.
struct Mean {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();
  double lowest = 1e9, mass = 0;
};

Mean mean_of(Simulation& simulation, int body) {
  auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
  tissue.momentum();  // brings it to the host
  const pbd::Vertices& v = tissue.state().vertices;
  Mean m;
  for (int i = 0; i < v.size(); ++i) {
    if (v.body[i] != body) continue;
    m.mass += v.mass[i];
    m.x += v.mass[i] * v.position(i);
    m.v += v.mass[i] * v.velocity(i);
    m.lowest = std::min(m.lowest, v.position(i).z());
  }
  m.x /= m.mass;
  m.v /= m.mass;
  return m;
}

TEST_P(Touches, WhatFallsOnAnotherRestsOnIt) {
  Scene scene = two_boxes(0.5, 0.01);
  scene.damping = 2;
  Simulation simulation(scene);
  const double from = mean_of(simulation, 1).x.z();
  for (int f = 0; f < 120; ++f) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  const Mean above = mean_of(simulation, 1);
  EXPECT_NEAR(above.x.z(), from - 0.01, 0.0008);
  EXPECT_NEAR(above.lowest, 0.005, 0.0008);
  EXPECT_LT(above.v.norm(), 0.005);
  EXPECT_LT(above.x.head<2>().norm(), 0.002);
}

TEST_P(Touches, FrictionHoldsUpToItsShareAndSlidesBeyond) {
  const double slope = 0.35, g = 9.81, seconds = 0.15;  // [rad]
  for (const double friction : {0.6, 0.15}) {
    Scene scene = two_boxes(friction, 0);
    scene.gravity = g * Vec3(std::sin(slope), 0, -std::cos(slope));
    Simulation simulation(scene);
    const int frames = static_cast<int>(seconds * scene.frame_rate);
    for (int f = 0; f < frames; ++f) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
    const double slid = mean_of(simulation, 1).x.x();
    const double alone = 0.5 * g * seconds * seconds;
    const double expected = alone * (std::sin(slope) - friction * std::cos(slope));
    if (expected < 0) {
      EXPECT_LT(slid, 0.01 * alone) << friction;
    } else {
      EXPECT_NEAR(slid, expected, 0.1 * alone * std::sin(slope)) << friction;
    }
  }
}

TEST_P(Touches, WhatOneGetsTheOtherLoses) {
  Scene scene = two_boxes(0.5, 0.003);
  scene.gravity = Vec3::Zero();
  scene.bodies[0].anchors.clear();
  Simulation simulation(scene);
  auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
  tissue.momentum();
  pbd::State& s = tissue.state();
  const double speed = 0.3;
  double mass = 0;
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (s.vertices.body[i] != 1) continue;
    s.vertices.v[4 * i + 2] = -static_cast<float>(speed);
    mass += s.vertices.mass[i];
  }
  std::vector<std::uint8_t> state = tissue.save();
  tissue.restore(state);  // to where the motion lives
  for (int f = 0; f < 30; ++f) ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  const Momentum after = tissue.momentum();
  EXPECT_NEAR(after.linear.z() / (-mass * speed), 1, 5e-3);
  EXPECT_LT(after.linear.head<2>().norm(), 5e-3 * mass * speed);
  const Mean below = mean_of(simulation, 0), above = mean_of(simulation, 1);
  EXPECT_LT(below.v.z(), -0.2 * speed * mass / after.mass);  // it was pushed
  EXPECT_GT(above.v.z(), below.v.z() - 0.02);                // nothing goes through
}

TEST_P(Touches, AreTheSameBitsRunAfterRun) {
  std::uint64_t sum[2];
  for (std::uint64_t& of : sum) {
    Scene scene = two_boxes(0.3, 0.002);
    scene.threads = &of == sum ? 1 : 3;
    Simulation simulation(scene);
    for (int f = 0; f < 30; ++f) simulation.advance_frame();
    of = simulation.tissue().checksum();
  }
  EXPECT_EQ(sum[0], sum[1]);
}

INSTANTIATE_TEST_SUITE_P(Each, Touches,
                         testing::Values(Case{PbdModel::kSurface, Device::kCpu},
                                         Case{PbdModel::kTetrahedra, Device::kCpu},
                                         Case{PbdModel::kSurface, Device::kCuda},
                                         Case{PbdModel::kTetrahedra, Device::kCuda}),
                         [](const auto& info) {
                           return std::string(info.param.model == PbdModel::kSurface
                                                  ? "surface"
                                                  : "tetrahedra") +
                                  (info.param.device == Device::kCpu ? "_cpu" : "_cuda");
                         });

// A corner beside two that are held moved by the gap over its share, and farther with each step.
TEST(Touch, MovesNoVertexFartherThanTheGap) {
  constexpr float kGap = 1e-4f;
  for (const float share : {0.5f, 0.02f, -0.05f}) {
    pbd::Vertex<float> v[4] = {
        {0.3f, share, -kGap, 0}, {0, 0, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 1000}};
    const float number[4] = {0, 0.3f, share, 0};
    float none[1] = {0};
    pbd::Touch::project(v, number, 1.0f, none);
    EXPECT_GT(std::fabs(v[3].moved.z), 0.99f * kGap) << share;
    EXPECT_LT(std::fabs(v[3].moved.z), 1.01f * kGap) << share;
  }
}

/// How far a vertex is from the triangle as the search has it [m]: 1e300
/// where it is none to touch.
double off_triangle(const pbd::State& s, int vertex, const Vec3& normal, const pbd::Triangle& t,
                    double reach) {
  const pbd::Vertices& v = s.vertices;
  const Vec3 a = v.position(t[0]), e = v.position(t[1]) - a, f = v.position(t[2]) - a;
  Eigen::Matrix3d axes;
  axes << e, f, e.cross(f).normalized();
  const Vec3 at = axes.inverse() * (v.position(vertex) - a);
  const double beside = std::max({0.0, -at[0], -at[1], at[0] + at[1] - 1});
  if (at[2] > reach || at[2] < -0.5 * s.mean_edge || beside > 0.3) return 1e300;
  if (axes.col(2).dot(normal.normalized()) > -0.25) return 1e300;
  return std::fabs(at[2]) + beside * s.mean_edge;
}

// At rest, and so fast that it looks as far as it may; far from the origin, where cells share slots
// with others.
TEST(SearchOfTouches, FindsWhatAllPairsHave) {
  for (const double speed : {0.0, 0.1, 3.0}) {
    Scene scene;
    scene.method = Method::kPbd;
    scene.cell_size = 0.005;
    scene.bodies.resize(2);
    for (int b = 0; b < 2; ++b) {
      Body& body = scene.bodies[b];
      body.name = b == 0 ? "one" : "other";
      body.shape = Shape::kEllipsoid;
      body.radii = Vec3(0.03, 0.02, 0.015);
      body.pose.position = Vec3(-1.3 + 0.01 * b, 0.7, 0.0299 * b);
    }
    PbdTissue tissue(scene);
    pbd::State& s = tissue.state();
    ASSERT_EQ(s.components, 2);
    std::mt19937 random(7);  // few are fast: most are looked for less far around than these
    std::exponential_distribution<double> share(4);
    std::vector<double> way(s.vertices.size(), speed / 60);
    for (int i = 0; i < s.vertices.size(); ++i) {
      way[i] *= i == 0 ? 1 : std::min(1.0, share(random));
      s.vertices.v[4 * i + i % 3] = static_cast<float>(60 * way[i]);
    }
    pbd::find_touches(s, 1.0 / 60);
    const pbd::Vertices& v = s.vertices;
    std::vector<Vec3> normal(v.size(), Vec3::Zero());
    for (const pbd::Triangle& t : s.triangles) {
      const Vec3 a = v.position(t[0]);
      for (const std::int32_t i : t) {
        normal[i] += (v.position(t[1]) - a).cross(v.position(t[2]) - a);
      }
    }
    const auto reach = [&](int i, const pbd::Triangle& t) {
      const double both = way[i] + std::max({way[t[0]], way[t[1]], way[t[2]]});
      return std::min(2.5, 0.3 + both / s.mean_edge) * s.mean_edge;
    };
    std::vector<double> found(v.size(), 1e300), expected = found;
    for (const auto& touch : s.touches.vertices) {
      const pbd::Triangle t = {touch[1], touch[2], touch[3]};
      found[touch[0]] = off_triangle(s, touch[0], normal[touch[0]], t, reach(touch[0], t));
    }
    int count = 0;
    for (int i = 0; i < v.size(); ++i) {
      for (const pbd::Triangle& t : s.triangles) {
        if (s.component[t[0]] == s.component[i]) continue;
        expected[i] = std::min(expected[i], off_triangle(s, i, normal[i], t, reach(i, t)));
      }
      EXPECT_NEAR(found[i], expected[i], 1e-9) << i << " at " << speed;  // 1e300: nothing
      count += expected[i] < 1e300 ? 1 : 0;
    }
    EXPECT_GT(count, 10);
    EXPECT_EQ(s.touches.size(), count);
  }
}

}  // namespace
}  // namespace tissue_sim
