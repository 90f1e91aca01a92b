// Scissors by what the node knows of them: pose, jaw angle, wrench, the jaws' moment.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

constexpr double kLength = 0.025, kOpen = 1.2;  // of the blades [m], [rad]

/// Bars along y, one after the other along z, between the blades of scissors at the origin that
/// point along z.
Scene bars(const std::vector<double>& middles, const Vec3& size) {
  Scene s;
  s.threads = 1;
  s.cell_size = 0.002;
  s.frame_rate = 100;
  s.gravity = Vec3::Zero();
  s.damping = 20;
  s.ground.enabled = false;
  s.materials.resize(1);
  Material& gel = s.materials[0];
  gel.name = "gel";
  gel.young_modulus = 1e5;
  gel.poisson_ratio = 0.3;
  gel.density = 1000;
  gel.viscosity = 1;
  for (std::size_t i = 0; i < middles.size(); ++i) {
    Body bar;
    bar.name = "bar_" + std::to_string(i);
    bar.material = "gel";
    bar.size = size;
    bar.pose.position = Vec3(0, 0, middles[i]);
    for (const double side : {-1.0, 1.0}) {
      Anchor held;
      held.kind = Region::Kind::kBox;
      const double at = 0.5 * size.y() - 0.003;
      held.min = Vec3(-1, side < 0 ? -1 : at, -1);
      held.max = Vec3(1, side < 0 ? -at : 1, 1);
      bar.anchors.push_back(held);
    }
    s.bodies.push_back(bar);
  }
  s.tools.resize(1);
  Tool& t = s.tools[0];
  t.name = "scissors";
  t.type = ToolType::kScissors;
  t.jaw_length = kLength;
  t.blade_width = 0.008;
  t.blade_thickness = 1e-4;
  t.friction = 0;
  return s;
}

/// From the hinge to where the edges cross [m].
double crossing(const Tool& tool, double jaw) {
  return 0.25 * tool.blade_width / std::sin(0.5 * jaw);
}

FrameResult go(Simulation& simulation, const Vec3& hinge, double jaw) {
  simulation.set_tool(0, {hinge + Vec3(0, 0, kLength), Quat::Identity()}, jaw);
  return simulation.advance_frame().result;
}

class Scissors : public EachMethod {};
FOR_EACH_METHOD(Scissors);

// Open ones are led over the bars and cut nothing; closing cuts one after the other from the hinge
// out, each once the edges crossed behind it; what is closed cuts no more.
TEST_P(Scissors, CutFromTheHingeOutAsTheyClose) {
  const std::vector<double> middles = {0.009, 0.014, 0.019};
  const Vec3 size(0.006, 0.02, 0.004);
  Simulation simulation(on_this(bars(middles, size)));
  const Tool& tool = simulation.scene().tools[0];
  for (double z = -0.025; z < 0; z += 0.0025) {
    EXPECT_EQ(go(simulation, Vec3(0, 0, z), kOpen).blade_report.bonds_broken, 0);
  }
  double jaw = kOpen;
  for (; jaw > 0.05; jaw -= 0.02) {
    go(simulation, Vec3::Zero(), jaw);
    const double slack = 0.001, at = crossing(tool, jaw);
    int least = 3, most = 3;
    for (const double middle : middles) {
      least += at > middle + 0.5 * size.z() + slack;
      most += at > middle - 0.5 * size.z() - slack;
    }
    const int pieces = simulation.tissue().fragment_count();
    EXPECT_GE(pieces, least) << jaw;
    EXPECT_LE(pieces, most) << jaw;
  }
  EXPECT_EQ(simulation.tissue().fragment_count(), 6);
  for (const double closed : {0.0, -0.2, 0.2, 0.0}) {
    EXPECT_EQ(go(simulation, Vec3::Zero(), closed).blade_report.bonds_broken, 0) << closed;
  }
}

// Closed ones push, whichever way they go, and so do open ones that do not close; they cut nothing.
TEST_P(Scissors, PushWhenTheyDoNotClose) {
  Scene scene = on_this(bars({0.014}, Vec3(0.008, 0.02, 0.014)));
  scene.tools[0].blade_thickness = 0.003;
  for (const double jaw : {0.0, 0.4}) {
    const double wide = kLength * std::sin(0.5 * jaw);
    for (const Vec3& way : {Vec3(-1, 0, 0), Vec3(0, 0, 1)}) {
      Simulation simulation(scene);
      const Vec3 from = way.z() > 0 ? Vec3(0, 0, 0.0065 - kLength) : Vec3(0.0105 + wide, 0, 0.001);
      FrameResult last;
      for (int i = 0; i < 20; ++i) {
        last = go(simulation, from + 0.0001 * i * way, jaw);
        EXPECT_EQ(last.blade_report.bonds_broken, 0);
      }
      EXPECT_LT(last.loads[0].mean.force.dot(way), -0.01) << way.transpose() << ", open by " << jaw;
    }
  }
}

// Toughness times what they cut, whatever its stiffness: the moment of each jaw while its edge lies
// in tissue from near to far, and the work of cutting, which the jaws do.
TEST_P(Scissors, TakeToughnessTimesArea) {
  if (GetParam().method == Method::kPbd) {
    GTEST_SKIP() << "blades cut without a force there, and toughness is refused";
  }
  for (const double stiffer : {1.0, 2.0}) {
    const Vec3 size(0.008, 0.024, 0.008);
    const double near = 0.011, far = near + size.z();
    Scene scene = on_this(bars({0.5 * (near + far)}, size));
    scene.cell_size = 0.0015;
    scene.mls.spacing = 0.0015;
    scene.materials[0].toughness = 40;
    scene.materials[0].young_modulus *= stiffer;
    const Tool& tool = scene.tools[0];
    Simulation simulation(scene);
    go(simulation, Vec3::Zero(), kOpen);
    double jaws = 0, cutting = 0, before = kOpen, moment = 0;
    int frames = 0;
    for (int frame = 1; frame <= 60; ++frame) {
      const double jaw = kOpen * (1 - frame / 60.0);
      const FrameResult result = go(simulation, Vec3::Zero(), jaw);
      const double of_jaws = result.loads[0].jaw_moment;
      jaws += of_jaws * (before - jaw);
      cutting += result.cutting_work;
      before = jaw;
      if (jaw > 0.5 || crossing(tool, jaw) > near) continue;
      moment += of_jaws;
      ++frames;
    }
    const double toughness = scene.materials[0].toughness;
    const double within = GetParam().method == Method::kMpm ? 0.15 : 0.3;
    const double theory = 0.5 * toughness * (far * far - near * near);
    EXPECT_TRUE(is_within("scissors: moment of a jaw over that of J", moment / frames / theory - 1,
                          within));
    EXPECT_TRUE(is_within("scissors: work of cutting over J times the area",
                          cutting / (toughness * size.x() * size.z()) - 1, within));
    EXPECT_GT(jaws, cutting);
    if (GetParam().method != Method::kMpm) continue;  // pairs that a rim weakened may hold on
    EXPECT_EQ(simulation.tissue().fragment_count(), 2);
  }
}

}  // namespace
}  // namespace tissue_sim
