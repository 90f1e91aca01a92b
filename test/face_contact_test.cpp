// Tissue against tissue: faces of cuts, pieces among themselves, folds. On the CPU and, where there
// is one, on the GPU.
#include <gtest/gtest.h>

#include <type_traits>

#include "contact/face_places.h"
#include "cut_scenes.h"
#include "momentum.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#endif

namespace tissue_sim {
namespace {

constexpr double kFrame = 1.0 / 60;

/// Nodes and contacts from, and nodes to, where the tissue lives.
void pull(MpmTissue&) {}
void push(MpmTissue& tissue) { measure_motion(tissue.state()); }
std::string why_not(const MpmTissue*) { return ""; }
#if defined(TISSUE_SIM_CUDA)
void pull(CudaMpmTissue& tissue) { tissue.pull(); }
void push(CudaMpmTissue& tissue) {
  tissue.push();
  tissue.advance(0, 1e-4f, {});
  tissue.finish();
}
std::string why_not(const CudaMpmTissue*) { return why_no_gpu(); }
using Tissues = testing::Types<MpmTissue, CudaMpmTissue>;
#else
using Tissues = testing::Types<MpmTissue>;
#endif

template <class T>
class FaceContactOf : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = why_not(static_cast<const T*>(nullptr));
    if (!why.empty()) GTEST_SKIP() << why;
  }
};
struct DeviceName {
  template <class T>
  static std::string GetName(int) {
    return std::is_same<T, MpmTissue>::value ? "OnCpu" : "OnGpu";
  }
};
TYPED_TEST_SUITE(FaceContactOf, Tissues, DeviceName);

template <class T>
FrameResult advance_frame(T& tissue) {
  const int n = static_cast<int>(std::ceil(kFrame / tissue.stable_substep()));
  tissue.advance(n, static_cast<float>(kFrame / n), {});
  return tissue.finish();
}

template <class T>
FrameResult advance(T& tissue, double seconds) {
  FrameResult result;
  for (int f = 0; f < std::lround(seconds / kFrame); ++f) result = advance_frame(tissue);
  return result;
}

double total(const FrameResult& r) { return r.kinetic_energy + r.elastic_energy; }

/// Throws each piece with a velocity of its own, turning about the origin.
template <class T>
void throw_pieces(T& tissue, const std::vector<Vec3>& velocity, const Vec3& spin) {
  pull(tissue);
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  for (int p = 0; p < s.points.size(); ++p) {
    const LatticeBody& b = s.bodies[s.points.site[p].body];
    for (int k = 0; k < 27; ++k) {
      const int node = s.fields->node(b, s.points.site[p], k);
      const Vec3 v = velocity[tissue.fragment_of(p)] + spin.cross(home[node]);
      for (int a = 0; a < 3; ++a) s.nodes.v[a][node] = static_cast<float>(v[a]);
    }
  }
  push(tissue);
}

/// Force of the strongest contact [N].
double strongest(const MpmState& s) {
  float largest = 0;
  for (const std::int32_t i : s.faces.active) {
    largest = std::max(largest, dot(s.faces.all[i].force, s.faces.all[i].force));
  }
  return std::sqrt(static_cast<double>(largest));
}

int touching(const MpmState& s) {
  int count = 0;
  for (const std::int32_t i : s.faces.active) count += s.faces.all[i].touching ? 1 : 0;
  return count;
}

/// Tissue that comes to rest: damped by its own viscosity.
Material viscous() {
  Material m;
  m.name = "viscous";
  m.viscosity = 5;
  return m;
}

/// The lowest corner of the box is at `low`.
Body box(const std::string& name, const Vec3& low, const Vec3& size) {
  Body body;
  body.name = name;
  body.size = size;
  body.pose.position = low + 0.5 * size;
  body.material = "viscous";
  return body;
}

Region below(double z) {
  Region region;
  region.z = z;
  return region;
}

TYPED_TEST(FaceContactOf, FreshCutIsFreeOfStress) {
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(1, 0.6, 0.3), Vec3(1, 1, 1)}) {
    TypeParam tissue(free_box(Vec3(0.03, 0.03, 0.03), 0.002));
    MpmState& s = tissue.state();
    pull(tissue);
    deform(s);
    push(tissue);
    cut_now(tissue, plane_cut(Vec3(0.02, 0.0171, 0.02), normal));
    ASSERT_EQ(tissue.fragments().size(), 2u);
    tissue.advance(1, 1e-6f, {});
    tissue.finish();
    pull(tissue);
    EXPECT_GT(s.faces.active.size(), 15u * 15u) << "the faces are found";
    double stiffest = 0;
    for (const std::int32_t i : s.faces.active) {
      stiffest = std::max<double>(stiffest, s.faces.all[i].stiffness);
    }
    EXPECT_LT(strongest(s), 1e-5 * stiffest * 0.002);
  }
}

TYPED_TEST(FaceContactOf, KeepsMomentumAndMakesNoEnergyWherePiecesCollideAndScrape) {
  TypeParam tissue(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3(1, 0.3, 0.1)));
  ASSERT_EQ(tissue.fragments().size(), 2u);
  const bool first_is_left = tissue.fragments()[0].centroid[0] < tissue.fragments()[1].centroid[0];
  std::vector<Vec3> velocity = {Vec3(0.15, 0.1, 0), Vec3(-0.15, -0.1, 0.05)};
  if (!first_is_left) std::swap(velocity[0], velocity[1]);
  throw_pieces(tissue, velocity, Vec3(2, 1, 3));
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  const Momentum start = momentum(s, home);
  tissue.advance(0, 1e-4f, {});
  double energy = total(tissue.finish());
  const double first = energy;
  int most = 0;
  for (int f = 0; f < 20; ++f) {
    const FrameResult r = advance_frame(tissue);
    pull(tissue);
    const Momentum now = momentum(s, home);
    EXPECT_LT((now.linear - start.linear).norm(), 3e-5 * start.linear.norm());
    EXPECT_LT((now.angular - start.angular).norm(), 3e-5 * start.angular.norm());
    // Velocities are half a substep behind: what rings seems to swing by a percent or two.
    EXPECT_LT(total(r), 1.02 * energy) << "frame " << f;
    energy = std::min(energy, total(r));
    most = std::max(most, touching(s));
  }
  EXPECT_GT(most, 20) << "they do collide";
  EXPECT_LT(energy, 0.9 * first) << "and scrape";
}

TYPED_TEST(FaceContactOf, NeverPulls) {
  TypeParam tissue(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3::UnitX()));
  const bool first_is_left = tissue.fragments()[0].centroid[0] < tissue.fragments()[1].centroid[0];
  std::vector<Vec3> velocity = {Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0)};
  if (!first_is_left) std::swap(velocity[0], velocity[1]);
  throw_pieces(tissue, velocity, Vec3::Zero());
  const MpmState& s = tissue.state();
  const float dt = tissue.stable_substep();
  bool touched = false;
  for (int i = 0; i < 200; ++i) {
    tissue.advance(1, dt, {});
    tissue.finish();
    pull(tissue);
    for (const std::int32_t c : s.faces.active) {
      EXPECT_GE(dot(s.faces.all[c].force, s.faces.all[c].normal), -1e-12);
    }
    touched = touched || touching(s) > 0;
  }
  EXPECT_TRUE(touched);
  EXPECT_EQ(touching(s), 0) << "they have bounced";
  const Span<const Fragment> pieces = tissue.fragments();
  EXPECT_GT(std::fabs(pieces[0].velocity[0] - pieces[1].velocity[0]), 0.05);
}

TYPED_TEST(FaceContactOf, PiecesPressedTogetherPartWithoutResistance) {
  TypeParam tissue(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3(1, 0.2, 0)));
  throw_pieces(tissue, {Vec3(0.1, 0, 0), Vec3(0.1, 0, 0)}, Vec3::Zero());
  advance(tissue, 0.05);  // side by side
  const bool first_is_left = tissue.fragments()[0].centroid[0] < tissue.fragments()[1].centroid[0];
  std::vector<Vec3> velocity = {Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0)};
  if (!first_is_left) std::swap(velocity[0], velocity[1]);
  throw_pieces(tissue, velocity, Vec3::Zero());
  tissue.advance(0, 1e-4f, {});
  const FrameResult before = tissue.finish();
  const FrameResult after = advance(tissue, 0.1);
  pull(tissue);
  EXPECT_EQ(touching(tissue.state()), 0);
  EXPECT_NEAR(total(after), total(before), 3e-3 * total(before));
  for (int p = 0; p < 2; ++p) {
    EXPECT_NEAR(tissue.fragments()[p].velocity[0], velocity[p][0], 1e-3);
  }
}

TYPED_TEST(FaceContactOf, ABlockStaysOnASlopeUpToTheAngleOfFrictionAndSlidesBeyond) {
  for (const double degrees : {14.0, 18.0, 24.0}) {  // friction 0.3: 16.7 degrees
    Scene scene = free_box(Vec3(0.07, 0.016, 0.01), 0.002);
    scene.materials = {viscous()};
    scene.bodies = {box("slope", Vec3::Zero(), Vec3(0.07, 0.016, 0.01)),
                    box("block", Vec3(0.003, 0.002, 0.0101), Vec3(0.016, 0.012, 0.008))};
    scene.bodies[0].anchors = {below(0.0085)};
    const double slope = degrees * M_PI / 180;
    scene.gravity = 9.81 * Vec3(std::sin(slope), 0, -std::cos(slope));
    TypeParam tissue(scene);
    advance(tissue, 0.15);
    const Fragment before = tissue.fragments()[1];
    const double time = 0.1;
    advance(tissue, time);
    const Fragment after = tissue.fragments()[1];
    EXPECT_NEAR(after.centroid[2], before.centroid[2], 1e-4);
    if (degrees < 16) {
      EXPECT_LT(after.velocity.norm(), 2e-3);
      EXPECT_NEAR(after.centroid[0], before.centroid[0], 1e-4);
    } else {
      const double expected = 9.81 * (std::sin(slope) - 0.3 * std::cos(slope));
      EXPECT_NEAR((after.velocity[0] - before.velocity[0]) / time, expected, 0.02 * expected);
    }
  }
}

TYPED_TEST(FaceContactOf, StackedPiecesComeToRestAndStay) {
  Scene scene = free_box(Vec3(0.02, 0.02, 0.02), 0.0025);
  scene.materials = {viscous()};
  scene.bodies[0].material = "viscous";
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  TypeParam tissue(scene);
  cut_now(tissue, plane_cut(Vec3(0.01, 0.01, 0.0126), Vec3(0.1, 0, 1)));
  cut_now(tissue, plane_cut(Vec3(0.01, 0.01, 0.0063), Vec3(0, -0.05, 1)));
  ASSERT_EQ(tissue.fragments().size(), 3u);
  advance(tissue, 2);
  std::vector<Vec3> place;
  for (const Fragment& f : tissue.fragments()) place.push_back(f.centroid);
  const FrameResult last = advance(tissue, 2);
  EXPECT_LT(last.kinetic_energy, 1e-6 * last.elastic_energy);
  EXPECT_LT(last.max_speed, 1e-5);
  for (std::size_t i = 0; i < place.size(); ++i) {
    EXPECT_LT((tissue.fragments()[i].centroid - place[i]).norm(), 2e-6);
  }
}

TYPED_TEST(FaceContactOf, AFlapFallsBackOntoItsBed) {
  Scene scene = free_box(Vec3(0.04, 0.012, 0.012), 0.002);
  scene.materials = {viscous()};
  scene.bodies[0].material = "viscous";
  scene.bodies[0].anchors = {below(0.004)};
  scene.gravity = Vec3(0, 0, -9.81);
  TypeParam tissue(scene);
  BladePath path;  // a level cut that leaves the last fifth whole
  path.edge = {Vec3(0, -0.1, 0), Vec3(0, 0.1, 0)};
  for (const double x : {-0.01, 0.032})
    path.poses.push_back({Vec3(x, 0, 0.0081), Quat::Identity()});
  cut_now(tissue, path);
  ASSERT_EQ(tissue.fragments().size(), 1u);
  MpmState& s = tissue.state();
  pull(tissue);
  const auto is_flap = [&](int p) { return s.points.site[p].z >= 8 && s.points.site[p].x < 32; };
  for (int p = 0; p < s.points.size(); ++p) {  // thrown up
    if (!is_flap(p)) continue;
    for (int k = 0; k < 27; ++k) {
      const int node = s.fields->node(s.bodies[0], s.points.site[p], k);
      if (s.nodes.inv_mass[node] > 0) s.nodes.v[2][node] = 0.4f;
    }
  }
  push(tissue);
  const auto gap = [&] {  // of the layers on both sides of the cut, at the flap's end [m]
    double top = 0, bed = 0;
    int n = 0, m = 0;
    std::vector<std::uint8_t> cloud;
    const int count = tissue.read_points({}, cloud);
    const auto* points = reinterpret_cast<const Point*>(cloud.data());
    for (int i = 0; i < count; ++i) {
      const Points::Site& site = s.points.site[points[i].id];
      if (site.x > 3) continue;
      if (site.z == 8) top += points[i].z, ++n;
      if (site.z == 7) bed += points[i].z, ++m;
    }
    return top / n - bed / m;
  };
  double widest = 0;
  for (int f = 0; f < 15; ++f) {
    advance_frame(tissue);
    widest = std::max(widest, gap());
  }
  EXPECT_GT(widest, 0.003) << "it opens";
  const FrameResult last = advance(tissue, 0.8);
  EXPECT_NEAR(gap(), 0.001, 0.0002) << "and lies on its bed again";
  pull(tissue);
  EXPECT_GT(touching(s), 20);
  EXPECT_LT(last.max_speed, 1e-3);
}

}  // namespace
}  // namespace tissue_sim
