// Tissue that lies on tissue: on a slope, in a stack, a flap on its bed. On the CPU and, where
// there is one, on the GPU.
#include <gtest/gtest.h>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

template <class T>
class FacesAtRestOf : public OnEitherDevice<T> {};
TYPED_TEST_SUITE(FacesAtRestOf, Tissues, DeviceName);

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

TYPED_TEST(FacesAtRestOf, ABlockStaysOnASlopeUpToTheAngleOfFrictionAndSlidesBeyond) {
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
      const double gained = (after.velocity[0] - before.velocity[0]) / time;
      EXPECT_TRUE(is_within("a block slides down a slope: g (sin a - 0.3 cos a)",
                            gained / expected - 1, 0.02));
    }
  }
}

TYPED_TEST(FacesAtRestOf, StackedPiecesComeToRestAndStay) {
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
  EXPECT_TRUE(is_at_most("three slices on one another, after 4 s", last.max_speed, 1e-5, "m/s"));
  for (std::size_t i = 0; i < place.size(); ++i) {
    EXPECT_LT((tissue.fragments()[i].centroid - place[i]).norm(), 2e-6);
  }
}

TYPED_TEST(FacesAtRestOf, AFlapFallsBackOntoItsBed) {
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
