// A part of a frame that tissue could not bear is undone, and done again with shorter substeps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "mpm/contact/face_contact.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/momentum.h"
#include "support/stability_limit.h"
#include "support/test_scenes.h"

namespace tissue_sim {
namespace {

template <class T>
class UndoneParts : public OnEitherDevice<T> {};
TYPED_TEST_SUITE(UndoneParts, Tissues, DeviceName);

double energy(const FrameResult& r) { return r.kinetic_energy + r.elastic_energy; }

/// A free body flies apart so fast that it stiffens manyfold before its first frame is over: the
/// substep that it bore at rest is too long by then. It then crumples; its faces pass through one
/// another, for where they met they would take energy.
TYPED_TEST(UndoneParts, TissueMayStiffenManyfoldWithinAFrame) {
  for (const float rate : {240.0f, 400.0f}) {  // [1/s]
    Scene scene = soft_body(0.3, Vec3(8, 8, 8));
    scene.damping = 0;
    TypeParam tissue(scene);
    pull(tissue);
    MpmState& s = tissue.state();
    for (Block* block : s.blocks.all) block->facets.clear();
    list_facets(s);
    const std::vector<Vec3> home = homes(s);
    for (std::size_t i = 0; i < home.size(); ++i) {
      for (int a = 0; a < 3; ++a) s.nodes.v[a][i] = rate * static_cast<float>(home[i][a]);
    }
    push(tissue);
    const double start = energy(tissue.finish());
    for (int frame = 0; frame < 10; ++frame) {
      tissue.advance(kFrame, {});
      const FrameResult r = tissue.finish();
      ASSERT_FALSE(r.blew_up) << rate << ", " << frame;
      EXPECT_LT(energy(r), 1.25 * start) << rate << ", " << frame;
      EXPECT_GT(energy(r), 0.9 * start) << rate << ", " << frame;
    }
  }
}

/// Faces that were cut rub against each other, and a probe presses them down.
TYPED_TEST(UndoneParts, WhatIsUndoneLeavesNothingBehind) {
  Scene scene = operation_scene(Vec3(0.08, 0.024, 0.028), Vec3(0, 0, 0.02));
  TypeParam tissue(scene);
  std::vector<ToolMotion> tools(2);
  tools[1].present = true;
  const Quat down = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const auto press = [&](int frame) {
    tools[1].begin = {Vec3(-0.01, 0, 0.036 - 0.0006 * frame), down};
    tools[1].end = {Vec3(-0.01, 0, 0.036 - 0.0006 * (frame + 1)), down};
    return FrameInput{tools, {}};
  };
  const std::vector<BladePath> cuts = {plane_cut(Vec3(0.005, 0, 0.02), Vec3(1, 0, 0.5)),
                                       plane_cut(Vec3(0.02, 0, 0.018), Vec3(0, 0.2, 1))};
  advance_by(tissue, 0, 0, {{}, cuts});
  tissue.finish();
  int frame = 0;
  for (; frame < 25; ++frame) {
    tissue.advance(kFrame, press(frame));
    ASSERT_FALSE(tissue.finish().blew_up);
  }
  pull(tissue);
  EXPECT_GT(touching(tissue.state()), 20);
  const float dt = 0.9f * tissue.stable_substep();
  const std::uint64_t before = tissue.checksum();
  // What comes after it is the same, but that the GPU then searches contacts anew.
  std::uint64_t end[3];
  double load[3];
  std::vector<Point> points[3];
  for (int i = 0; i < 3; ++i) {
    FixedSubsteps::keep(tissue);
    advance_by(tissue, 20, dt, press(frame));
    const FrameResult r = tissue.finish();
    ASSERT_FALSE(r.blew_up);
    load[i] = r.loads[1].mean.force.norm();
    EXPECT_GT(load[i], 0.1);
    end[i] = tissue.checksum();
    EXPECT_NE(end[i], before);
    std::vector<std::uint8_t> cloud;
    points[i].resize(tissue.read_points({}, cloud));
    std::memcpy(points[i].data(), cloud.data(), cloud.size());
    FixedSubsteps::go_back(tissue);
    ASSERT_EQ(tissue.checksum(), before);
  }
  EXPECT_EQ(end[1], end[2]);
  EXPECT_EQ(load[1], load[2]);
  float most = 0;
  for (std::size_t i = 0; i < points[0].size(); ++i) {
    const Point &a = points[0][i], &b = points[1][i];
    most = std::max({most, std::fabs(a.x - b.x), std::fabs(a.y - b.y), std::fabs(a.z - b.z)});
  }
  std::printf("load %.3f N, places differ by up to %.1e cells\n", load[0], most / scene.cell_size);
  const bool exact = std::is_same<TypeParam, MpmTissue>::value;
  if (exact) {
    EXPECT_EQ(end[0], end[1]);
  }
  EXPECT_LE(std::fabs(load[1] - load[0]), exact ? 0 : 0.02 * load[0]);
  EXPECT_LE(most, exact ? 0 : 0.05 * scene.cell_size);
}

}  // namespace
}  // namespace tissue_sim
