// Blades in tissue that resists them: forces and work of cutting, by what the field knows of both.
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

constexpr double kToughness = 100, kYoungModulus = 1e5;  // [J/m^2], [Pa]: J / E is 1 mm

/// A slab that stands on its anchor and a blade with its edge along x over it, which cuts downward
/// in y = 0. It reaches over both of the slab's sides.
struct Slab {
  double width = 0.012;                      ///< along the edge [m]
  double cell = 0.0015;                      ///< [m]
  double height = 0.012, thickness = 0.012;  ///< [m]
  double toughness = kToughness;
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
  s.materials[0].toughness = slab.toughness;
  s.bodies.resize(1);
  s.bodies[0].material = "gel";
  s.bodies[0].size = Vec3(slab.width, slab.thickness, slab.height);
  s.bodies[0].pose.position = Vec3(0, 0, 0.5 * slab.height);
  Region held;
  held.z = 0.001;
  s.bodies[0].anchors = {held};
  s.tools.resize(1);
  Tool& t = s.tools[0];
  t.name = "blade";
  t.type = ToolType::kScalpel;
  t.blade_length = 0.06;
  t.blade_width = 0.03;
  t.blade_thickness = slab.blade_thickness;
  t.blade_edge_radius = slab.edge_radius;
  t.friction = slab.friction;
  return s;
}

class Stroke {
 public:
  Stroke(const Scene& scene, double height)
      : simulation_(scene), tip_(0.5 * scene.bodies[0].size.x() + 0.005, 0, height + 0.0005) {
    go(Vec3::Zero());
  }
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
  const FrameResult& last() const { return last_; }
  double hand_work = 0, cutting_work = 0;  ///< [J]

 private:
  Simulation simulation_;
  Vec3 tip_;
  FrameResult last_;
};

/// Over the lower part of a stroke, where the force is steady [N].
struct Steady {
  Vec3 mean = Vec3::Zero();
  double least = 1e30, most = 0;                    ///< of the push
  double hand_work = 0, cutting_work = 0, way = 0;  ///< [J], [J], downward [m]
};

constexpr double kSpeed = 0.05, kFrame = 0.01;  // [m/s], [s]

Steady cut_down(const Scene& scene, double slicing) {
  const double height = scene.bodies[0].size.z();
  Stroke stroke(scene, height);
  Steady steady;
  int frames = 0;
  double hand_work = 0, cutting_work = 0, from = 0;
  while (stroke.height() > 0.35 * height) {
    const Vec3 force = stroke.go(kSpeed * kFrame * Vec3(-slicing, 0, -1));
    if (stroke.height() > 0.65 * height) {
      hand_work = stroke.hand_work;
      cutting_work = stroke.cutting_work;
      from = stroke.height();
      continue;
    }
    steady.mean += force;
    steady.least = std::min(steady.least, force.z());
    steady.most = std::max(steady.most, force.z());
    ++frames;
  }
  steady.mean /= frames;
  steady.hand_work = stroke.hand_work - hand_work;
  steady.cutting_work = stroke.cutting_work - cutting_work;
  steady.way = from - stroke.height();
  return steady;
}

class CuttingForce : public EachMethod {
 protected:
  void SetUp() override {
    EachMethod::SetUp();
    if (IsSkipped()) return;
    if (GetParam().method == Method::kPbd || GetParam().device == Device::kCuda) {
      GTEST_SKIP() << "blades cut without a force there, and toughness is refused";
    }
  }
};
FOR_EACH_METHOD(CuttingForce);

// F = J w, whatever the size of cells; as it cuts, the hand's work is what cutting takes.
TEST_P(CuttingForce, IsToughnessTimesWidth) {
  for (const auto& [width, cell] : std::initializer_list<std::pair<double, double>>{
           {0.012, 0.0015}, {0.012, 0.002}, {0.012, 0.0012}, {0.006, 0.0015}, {0.018, 0.0015}}) {
    Slab slab;
    slab.width = width;
    slab.cell = cell;
    const Steady steady = cut_down(on_this(scene_of(slab)), 0);
    const double theory = kToughness * width;
    EXPECT_NEAR(steady.mean.z(), theory, 0.05 * theory) << width << " m, cells of " << cell;
    EXPECT_NEAR(steady.cutting_work, theory * steady.way, 0.05 * theory * steady.way)
        << width << " m, cells of " << cell;
    EXPECT_LT(steady.most - steady.least, 0.1 * theory) << width << " m, cells of " << cell;
  }
}

// Atkins: 1 / (1 + xi^2) of it downward, xi / (1 + xi^2) along the edge.
TEST_P(CuttingForce, FallsWithSlicing) {
  for (const double xi : {1.0, 2.0}) {
    Slab slab;
    const Steady steady = cut_down(on_this(scene_of(slab)), xi);
    const double share = kToughness * slab.width / (1 + xi * xi);
    EXPECT_NEAR(steady.mean.z(), share, 0.1 * share) << xi;
    EXPECT_NEAR(steady.mean.x(), xi * share, 0.1 * xi * share) << xi;
  }
}

// E r more for each area.
TEST_P(CuttingForce, GrowsWithTheEdgesRadius) {
  Slab slab;
  slab.blade_thickness = 0.0012;
  double before = 0;
  for (const double radius : {0.0, 0.0002, 0.0005}) {
    slab.edge_radius = radius;
    const double force = cut_down(on_this(scene_of(slab)), 0).mean.z();
    const double theory = (kToughness + kYoungModulus * radius) * slab.width;
    EXPECT_NEAR(force, theory, 0.1 * theory) << radius;
    EXPECT_GT(force, 1.05 * before);
    before = force;
  }
}

// A blade that rests in tissue cuts nothing and is pushed steadily; drawn back and moved along what
// it cut it meets nothing.
TEST_P(CuttingForce, RestsAndGoesBackFreely) {
  const Slab slab;
  const Scene scene = on_this(scene_of(slab));
  Stroke stroke(scene, slab.height);
  EXPECT_LT(stroke.go(Vec3::Zero()).norm(), 1e-9);
  const double step = kSpeed * kFrame;
  while (stroke.height() > 0.5 * slab.height) stroke.go(Vec3(0, 0, -step));
  for (int i = 0; i < 10; ++i) stroke.go(Vec3::Zero());
  const double cut = stroke.cutting_work, pushed = stroke.go(Vec3::Zero()).z();
  EXPECT_GT(pushed, 0.5 * kToughness * slab.width);
  for (int i = 0; i < 20; ++i) {
    const double force = stroke.go(Vec3::Zero()).z();
    EXPECT_NEAR(force, pushed, 0.01 * pushed);
    EXPECT_EQ(stroke.last().blade_report.bonds_broken, 0);
  }
  EXPECT_EQ(stroke.cutting_work, cut);
  for (int i = 0; i < 6; ++i) stroke.go(Vec3(0, 0, step));  // out of what it presses
  const double least = 0.03 * kToughness * slab.width;
  for (int i = 0; i < 3; ++i) EXPECT_LT(stroke.go(Vec3(0, 0, step)).norm(), least);
  for (int i = 0; i < 3; ++i) EXPECT_LT(stroke.go(Vec3(0, 0, -step)).norm(), least);
  EXPECT_EQ(stroke.cutting_work, cut);
}

}  // namespace
}  // namespace tissue_sim
