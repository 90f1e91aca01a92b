// Blades in tissue that resists them: forces and work of cutting, by what the field knows of both.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <utility>
#include <vector>

#include "cutting/edge_corners.h"
#include "support/curve_file.h"
#include "support/finite_element_scenes.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

constexpr double kToughness = 100, kYoungModulus = 1e5;  // [J/m^2], [Pa]: J / E is 1 mm

/// A slab that stands on its anchor and a blade with its edge along x over it, which cuts downward
/// in y = 0. It reaches over both of the slab's sides.
struct Slab {
  double width = 0.012;                      ///< along the edge [m]
  double cell = 0.0015;                      ///< [m]
  double height = 0.021, thickness = 0.015;  ///< [m]
  double edge_radius = 0, friction = 0, blade_thickness = 1e-4;
};

Scene scene_of(const Slab& slab) {
  Scene s;
  s.threads = 1;
  s.cell_size = slab.cell;
  s.frame_rate = 100;
  s.gravity = Vec3::Zero();
  s.ground.enabled = false;
  s.materials.resize(1);
  s.materials[0].name = "gel";
  s.materials[0].young_modulus = kYoungModulus;
  s.materials[0].poisson_ratio = 0.3;
  s.materials[0].density = 1000;
  s.materials[0].viscosity = 1;
  s.materials[0].toughness = kToughness;
  s.bodies.resize(1);
  s.bodies[0].material = "gel";
  s.bodies[0].size = Vec3(slab.width, slab.thickness, slab.height);
  s.bodies[0].pose.position = Vec3(0, 0, 0.5 * slab.height);
  Region held;
  held.z = 0.003;
  s.bodies[0].anchors = {held};
  s.tools.resize(1);
  Tool& t = s.tools[0];
  t.name = "blade";
  t.type = ToolType::kScalpel;
  t.blade_length = 0.11;
  t.blade_width = 0.03;
  t.blade_thickness = slab.blade_thickness;
  t.blade_edge_radius = slab.edge_radius;
  t.friction = slab.friction;
  return s;
}

class Stroke {
 public:
  /// `beyond` is how far the blade reaches over the slab's side [m].
  Stroke(const Scene& scene, double beyond)
      : simulation_(scene),
        tip_(0.5 * scene.bodies[0].size.x() + beyond, 0, scene.bodies[0].size.z() + 0.0005) {}
  /// Moves on within a frame; the force of the tissue on the blade [N].
  Vec3 go(const Vec3& by) {
    Eigen::Matrix3d axes;  // the edge looks down, the tip along x
    axes << 0, 0, 1, 0, 1, 0, -1, 0, 0;
    tip_ += by;
    simulation_.set_tool(0, {tip_, Quat(axes)});
    last_ = simulation_.advance_frame().result;
    const Vec3 force = last_.loads[0].mean.force;
    hand_work -= force.dot(by);
    cutting_work += last_.cutting_work;
    return force;
  }
  double height() const { return tip_.z(); }
  Simulation& simulation() { return simulation_; }
  const FrameResult& last() const { return last_; }
  /// Goes on from where another is.
  void restore(Stroke& other) {
    std::vector<std::uint8_t> saved = other.simulation_.save();
    simulation_.restore(saved);
    tip_ = other.tip_;
  }
  double hand_work = 0, cutting_work = 0;  ///< [J]

 private:
  Simulation simulation_;
  Vec3 tip_;
  FrameResult last_;
};

/// Over the lower part of a stroke, where the force is steady [N].
struct Steady {
  Vec3 mean = Vec3::Zero();
  double least = 1e30, most = 0;  ///< of the push
};

constexpr double kFrame = 0.01;  // [s]

/// Of a blade that goes down at this speed [m/s], and along its edge so many times as fast.
Steady cut_down(const Scene& scene, double speed = 0.05, double slicing = 0) {
  const double height = scene.bodies[0].size.z();
  Stroke stroke(scene, 0.005 + slicing * height);
  Steady steady;
  int frames = 0;
  while (stroke.height() > 0.35 * height) {
    const Vec3 force = stroke.go(speed * kFrame * Vec3(-slicing, 0, -1));
    if (stroke.height() > 0.65 * height) continue;
    steady.mean += force;
    steady.least = std::min(steady.least, force.z());
    steady.most = std::max(steady.most, force.z());
    ++frames;
  }
  steady.mean /= frames;
  return steady;
}

class CuttingForce : public EachMethod {
 protected:
  void SetUp() override {
    EachMethod::SetUp();
    if (IsSkipped()) return;
    if (GetParam().method == Method::kPbd) {
      GTEST_SKIP() << "blades cut without a force there, and toughness is refused";
    }
  }
};
FOR_EACH_METHOD(CuttingForce);

// F = J w, whatever the size of cells.
TEST_P(CuttingForce, IsToughnessTimesWidth) {
  for (const auto& [width, cell] : std::initializer_list<std::pair<double, double>>{
           {0.012, 0.0015}, {0.012, 0.002}, {0.012, 0.0012}, {0.018, 0.0015}}) {
    Slab slab;
    slab.width = width;
    slab.cell = cell;
    const Steady steady = cut_down(on_this(scene_of(slab)));
    const double theory = kToughness * width;
    EXPECT_TRUE(is_within("force over J w, 12, 18 mm, cells 1.2 to 2 mm",
                          steady.mean.z() / theory - 1, 0.05))
        << width << " m, cells of " << cell;
    EXPECT_TRUE(
        is_at_most("from frame to frame, of J w", (steady.most - steady.least) / theory, 0.1, "%"))
        << width << " m, cells of " << cell;
  }
}

// A blade with a tip of 1 mm, as thick as J / E, goes into a slab twice as wide as it is high,
// bonded below, Poisson's ratio 0: plane strain. Before it cuts its load is that of contact, and it
// cuts where that comes to J w.
TEST_P(CuttingForce, BreaksAtTheDepthOfContact) {
  constexpr double kStep = 0.0001;
  for (const double height : {0.012, 0.024}) {
    const std::string of = "blade_" + std::to_string(std::lround(1e3 * height)) + "mm";
    const double theory = reference(TISSUE_SIM_TEST_DATA, of, "depth");
    for (const double cell : {0.003, 0.002, 0.0015}) {
      if (height > 0.02 && cell < 0.002) continue;
      Slab slab;
      slab.width = 0.006;
      slab.cell = cell;
      slab.height = height + 2 * cell;
      slab.thickness = 2 * height;
      slab.blade_thickness = 0.002;
      Scene scene = on_this(scene_of(slab));
      scene.damping = 20;
      scene.materials[0].law = Law::kNeoHookean;
      scene.materials[0].poisson_ratio = 0;
      scene.bodies[0].anchors[0].z = 2 * cell;
      Stroke stroke(scene, 0.005);
      CurveFile curve(std::string("cutting_") +
                          (GetParam().method == Method::kMls ? "mls" : "mpm") + "_" + of + "_" +
                          std::to_string(std::lround(1e6 * cell)),
                      "depth [m],push over J w,work of cutting [J]");
      double at_break = 0;
      for (double depth = -0.0005; depth < 1.5 * theory;) {
        depth += kStep;
        const double push = stroke.go(Vec3(0, 0, -kStep)).z() / (kToughness * slab.width);
        curve.add({depth, push, stroke.cutting_work});
        if (at_break == 0 && push > 0.98) at_break = depth;
      }
      EXPECT_TRUE(is_within("depth at break over that of contact, cells of 1.5 to 3 mm",
                            at_break / theory - 1, 0.15))
          << of << ", cells of " << cell;
    }
  }
}

/// A slab which both its sides hold.
Scene held_at_sides(Slab slab) {
  slab.height = 0.018;
  slab.thickness = 0.018;
  Scene scene = scene_of(slab);
  scene.damping = 20;
  std::vector<Anchor> held(2, scene.bodies[0].anchors[0]);
  for (int side = 0; side < 2; ++side) {
    held[side].kind = Region::Kind::kBox;
    held[side].min = Vec3(-1, side == 0 ? -1 : 0.006, -1);
    held[side].max = Vec3(1, side == 0 ? -0.006 : 1, 1);
  }
  scene.bodies[0].anchors = held;
  return scene;
}

// A cut through all of it: J times its area, all of it the hand's.
TEST_P(CuttingForce, TakesToughnessTimesArea) {
  const Slab slab;
  const Scene scene = on_this(held_at_sides(slab));
  Stroke stroke(scene, 0.005);
  while (stroke.height() > -0.01) stroke.go(Vec3(0, 0, -0.0005));
  const double theory = kToughness * slab.width * scene.bodies[0].size.z();
  EXPECT_TRUE(
      is_within("work of cutting over J times the area", stroke.cutting_work / theory - 1, 0.05));
  EXPECT_TRUE(is_within("work of the hand", stroke.hand_work / theory - 1, 0.1));
  EXPECT_EQ(stroke.simulation().tissue().fragment_count(), 2);
}

// Tissue at a side of the slab goes down with the edge, which lets it go; what hangs through the
// blade then is cut.
TEST_P(CuttingForce, LeavesNoStrandWhereItWentThrough) {
  for (const auto& [toughness, cell] :
       std::initializer_list<std::pair<double, double>>{{200, 0.0015}, {100, 0.0017}}) {
    Slab slab;
    slab.cell = cell;
    Scene scene = on_this(held_at_sides(slab));
    scene.materials[0].toughness = toughness;
    Stroke stroke(scene, 0.005);
    while (stroke.height() > -0.01) stroke.go(Vec3(0, 0, -0.0005));
    Tissue& tissue = stroke.simulation().tissue();
    std::vector<int> sizes;
    for (const Fragment& f : tissue.fragments()) sizes.push_back(f.point_count);
    std::sort(sizes.rbegin(), sizes.rend());
    ASSERT_GE(sizes.size(), 2u) << toughness << " J/m^2, cells of " << cell;
    EXPECT_GT(sizes[1], 0.4 * tissue.point_count());
    EXPECT_GE(sizes[0] + sizes[1], 0.99 * tissue.point_count());
  }
}

// Atkins: 1 / (1 + xi^2) of it downward, xi / (1 + xi^2) along the edge.
void expect_atkins(Slab slab, const Steady& steady, double xi) {
  const double share = kToughness * slab.width / (1 + xi * xi);
  const std::string at = "slicing at xi " + std::to_string(std::lround(xi));
  EXPECT_TRUE(is_within(at + ": push", steady.mean.z() / share - 1, 0.1));
  EXPECT_TRUE(is_within(at + ": along the edge", steady.mean.x() / (xi * share) - 1, 0.1));
}
constexpr Slab kWide{0.024, 0.002, 0.016, 0.012};

TEST_P(CuttingForce, FallsWithSlicing) {
  expect_atkins(kWide, cut_down(on_this(scene_of(kWide)), 0.05, 1), 1);
}

TEST_P(CuttingForce, FallsWithMuchSlicing) {
  expect_atkins(kWide, cut_down(on_this(scene_of(kWide)), 0.005, 2), 2);
}

// E r more for each area.
TEST_P(CuttingForce, GrowsWithTheEdgesRadius) {
  Slab slab;
  slab.blade_thickness = 0.0012;
  double before = 0;
  for (const double radius : {0.0, 0.0002, 0.0005}) {
    slab.edge_radius = radius;
    const double force = cut_down(on_this(scene_of(slab))).mean.z();
    const double theory = (kToughness + kYoungModulus * radius) * slab.width;
    EXPECT_TRUE(is_within("dull edge to 0.5 mm: J + E r", force / theory - 1, 0.1)) << radius;
    EXPECT_GT(force, 1.05 * before);
    before = force;
  }
}

// A blade that rests in tissue cuts nothing and is pushed steadily; drawn back and moved along what
// it cut it meets nothing.
TEST_P(CuttingForce, RestsAndGoesBackFreely) {
  Slab slab;
  slab.blade_thickness = 0.0004;
  Scene scene = on_this(scene_of(slab));
  scene.damping = 20;
  Stroke stroke(scene, 0.005);
  EXPECT_LT(stroke.go(Vec3::Zero()).norm(), 1e-9);  // in the air
  const double step = 0.0005;
  while (stroke.height() > 0.5 * slab.height) stroke.go(Vec3(0, 0, -step));
  for (int i = 0; i < 40; ++i) stroke.go(Vec3::Zero());
  const double cut = stroke.cutting_work, pushed = stroke.go(Vec3::Zero()).z();
  EXPECT_GT(pushed, 0.5 * kToughness * slab.width);
  for (int i = 0; i < 20; ++i) {
    const double force = stroke.go(Vec3::Zero()).z();
    EXPECT_TRUE(is_within("a blade that rests: its force stays", force / pushed - 1, 0.01));
    EXPECT_EQ(stroke.last().blade_report.bonds_broken, 0);
  }
  EXPECT_EQ(stroke.cutting_work, cut);
  for (int i = 0; i < 6; ++i) stroke.go(Vec3(0, 0, step));  // out of what it presses
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(is_at_most("drawn back: force, of J w",
                           stroke.go(Vec3(0, 0, step)).norm() / (kToughness * slab.width), 0.03,
                           "%"));
  }
  EXPECT_NEAR(stroke.cutting_work, cut, 1e-3 * cut);
}

TEST_P(CuttingForce, OfANarrowSlab) {
  Slab slab;
  slab.width = 0.006;
  const double theory = kToughness * slab.width;
  EXPECT_TRUE(is_within("force over J w, 4 cells wide",
                        cut_down(on_this(scene_of(slab))).mean.z() / theory - 1, 0.05));
}

TEST_P(CuttingForce, AlongAFinishedCutIsNone) {
  Slab slab;
  slab.blade_thickness = 0.0004;
  Scene scene = on_this(scene_of(slab));
  scene.damping = 20;
  Stroke stroke(scene, 0.005);
  const Vec3 down(0, 0, -0.0005);
  while (stroke.height() > 0.5 * slab.height) stroke.go(down);
  for (int i = 0; i < 9; ++i) stroke.go(-down);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(is_at_most("along a finished cut: force, of J w",
                           stroke.go(down).norm() / (kToughness * slab.width), 0.03, "%"));
  }
}

TEST_P(CuttingForce, GoesOnFromASavedState) {
  Slab slab;
  slab.cell = 0.002;
  const Scene scene = on_this(scene_of(slab));
  const Vec3 down(0, 0, -0.0005);
  Stroke whole(scene, 0.005), rest(scene, 0.005);
  for (int i = 0; i < 16; ++i) whole.go(down);
  ASSERT_GT(whole.cutting_work, 0);
  rest.restore(whole);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(rest.go(down), whole.go(down));
  EXPECT_EQ(rest.simulation().tissue().checksum(), whole.simulation().tissue().checksum());
}

// What pieces of an edge do is worked out on threads.
TEST_P(CuttingForce, IsTheSameOnAnyNumberOfThreads) {
  Slab slab;
  slab.cell = 0.002;
  Scene scene = on_this(scene_of(slab));
  Stroke one(scene, 0.005);
  scene.threads = 3;
  Stroke three(scene, 0.005);
  const Vec3 way(-0.0003, 0, -0.0005);
  for (int i = 0; i < 16; ++i) EXPECT_EQ(one.go(way), three.go(way));
  ASSERT_GT(one.cutting_work, 0);
  EXPECT_EQ(one.simulation().tissue().checksum(), three.simulation().tissue().checksum());
}

// In frames for hands, in which an edge goes on by less than a hundredth of a cell, the cut follows
// all the same: what was paid for is parted, and nothing beside it.
TEST_P(CuttingForce, IsTheSameInShortFrames) {
  Slab slab;
  slab.cell = 0.002;
  slab.height = 0.012;
  Scene scene = on_this(scene_of(slab));
  double parted[2] = {}, work[2] = {};
  for (const int k : {0, 1}) {
    scene.frame_rate = k == 0 ? 100 : 2000;
    const double step = 0.03 / scene.frame_rate;
    Stroke stroke(scene, 0.005);
    while (stroke.height() > 0.35 * slab.height) {
      stroke.go(Vec3(0, 0, -step));
      parted[k] += stroke.last().blade_report.bonds_broken;
    }
    work[k] = stroke.cutting_work;
  }
  ASSERT_GT(parted[0], 0);
  EXPECT_TRUE(is_within("frames of 0.5 ms for 10: work of cutting", work[1] / work[0] - 1, 0.05));
  // Long frames leave more of a cell for later; paths that overlapped parted a quarter too many.
  EXPECT_TRUE(
      is_within("frames of 0.5 ms for 10: what is parted", parted[1] / parted[0] - 1, 0.15));
}

TEST(EdgeCorners, StayWhereTheLineIsNotStraight) {
  std::vector<Vec3> begin, end;
  for (int i = 0; i <= 20; ++i) {
    begin.emplace_back(0.1 * i, i == 15 ? 0.02 : 0.0, 0.0);
    end.emplace_back(0.1 * i, 0.0, i == 7 ? 0.03 : i == 12 ? 0.004 : 0);
  }
  const std::vector<std::size_t> kept = corners_of({&begin, &end}, 0.01);
  EXPECT_EQ(kept.front(), 0u);
  EXPECT_EQ(kept.back(), 20u);
  for (const std::size_t corner : {7, 15}) {
    EXPECT_EQ(std::count(kept.begin(), kept.end(), corner), 1) << corner;
  }
  EXPECT_LT(kept.size(), 10u);
  for (std::size_t k = 0; k + 1 < kept.size(); ++k) {  // none is farther off
    for (std::size_t i = kept[k]; i < kept[k + 1]; ++i) {
      const double share = double(i - kept[k]) / double(kept[k + 1] - kept[k]);
      for (const std::vector<Vec3>* of : {&begin, &end}) {
        const Vec3 on = (1 - share) * (*of)[kept[k]] + share * (*of)[kept[k + 1]];
        EXPECT_LE((on - (*of)[i]).norm(), 0.01);
      }
    }
  }
}

}  // namespace
}  // namespace tissue_sim
