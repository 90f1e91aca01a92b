// Bodies of two materials against the theory of composites, and what follows from their masses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"

namespace tissue_sim {
namespace {

Inclusion box_of(const std::string& material, const Vec3& min, const Vec3& max) {
  Inclusion i;
  i.material = material;
  i.region.kind = Region::Kind::kBox;
  i.region.min = min;
  i.region.max = max;
  return i;
}

/// A block with its lowest corner at the origin, of a soft material and, in a box, a stiff one.
Scene layered(const Vec3& size, double nu, const Vec3& min, const Vec3& max) {
  Scene s = free_box(size, 0.002);
  s.damping = 60;
  s.materials.resize(2);
  for (int i = 0; i < 2; ++i) {
    s.materials[i].name = i == 0 ? "soft" : "stiff";
    s.materials[i].young_modulus = i == 0 ? 4e3 : 16e3;
    s.materials[i].poisson_ratio = nu;
  }
  s.bodies[0].material = "soft";
  s.bodies[0].inclusions = {box_of("stiff", min, max)};
  return s;
}

/// Grips all that is within two cells of both ends along `axis`, moves the far end along
/// `direction` and waits until the tissue is at rest.
void pull(MpmTissue& tissue, int axis, int direction, double by) {
  MpmState& s = tissue.state();
  const double length = s.scene.bodies[0].size[axis], ends = 2 * s.scene.cell_size;
  grip(s, [=](const Vec3& x, double margin) {
    return x[axis] < ends + margin || x[axis] > length - ends - margin;
  });
  const std::vector<Vec3> home = homes(s);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const double share = home[i][axis] / length;
    const bool held = s.nodes.inv_mass[i] == 0;
    s.nodes.u[direction][i] = static_cast<float>(by * (held ? std::round(share) : share));
  }
  for (int frame = 0; frame < 100; ++frame) {
    advance_by(tissue, 100, tissue.stable_substep(), {});
    if (tissue.finish().kinetic_energy < 1e-15) break;
  }
}

/// A point in reference space, what it has moved by and the stress that clouds show.
struct At {
  Vec3 home, moved;
  double stress;
};

std::vector<At> points_of(MpmTissue& tissue) {
  std::vector<std::uint8_t> cloud;
  std::vector<Point> points(tissue.read_points({}, cloud));
  std::memcpy(points.data(), cloud.data(), cloud.size());
  std::vector<At> all;
  for (const Point& p : points) {
    const Points::Site& s = tissue.state().points.site[p.id];
    const Vec3 home = tissue.state().bodies[0].site_position(s.x, s.y, s.z);
    all.push_back({home, Vec3(p.x, p.y, p.z) - home, p.stress});
  }
  return all;
}

/// Mean over the points at `share` of the size along `axis`, within a tenth of it, for near
/// steps and grips neighbours on the lattice differ; of those within a cell of the middle along
/// `across`, where the free sides are far.
At plane(MpmTissue& tissue, int axis, double share, int across) {
  const Vec3 size = tissue.state().scene.bodies[0].size;
  const double h = tissue.state().scene.cell_size;
  At sum{Vec3::Zero(), Vec3::Zero(), 0};
  int count = 0;
  for (const At& p : points_of(tissue)) {
    if (std::fabs(p.home[axis] - share * size[axis]) > 0.1 * size[axis]) continue;
    if (across != axis && std::fabs(p.home[across] - 0.5 * size[across]) > h) continue;
    sum.home += p.home;
    sum.moved += p.moved;
    sum.stress += p.stress;
    ++count;
  }
  EXPECT_GT(count, 0) << share;
  return {sum.home / count, sum.moved / count, sum.stress / count};
}

/// Two layers of equal thickness one after the other along `axis`, the far end moved along
/// `direction`: they bear the same stress, each strained by its own stiffness (Reuss). `modulus`:
/// the stress that clouds show over the strain of the soft layer and of the stiff one.
void expect_series(MpmTissue& tissue, int axis, int direction, const double (&modulus)[2]) {
  const auto at = [&](double share) { return plane(tissue, axis, share, direction); };
  const auto strain = [&](double from, double to) {
    const At a = at(from), b = at(to);
    return (b.moved[direction] - a.moved[direction]) / (b.home[axis] - a.home[axis]);
  };
  const double stress = at(0.3).stress;
  const std::string what = "layers one after the other: stress and strain";
  EXPECT_TRUE(is_within(what, at(0.7).stress / stress - 1, 0.01));
  EXPECT_TRUE(is_within(what, modulus[0] * strain(0.25, 0.35) / stress - 1, 0.01));
  EXPECT_TRUE(is_within(what, modulus[1] * strain(0.65, 0.75) / stress - 1, 0.01));
  // From the middle of one layer to that of the other, what the lattice makes of the step included.
  const double theory = 0.5 * stress * (1 / modulus[0] + 1 / modulus[1]);
  EXPECT_TRUE(is_within("their strain from middle to middle", strain(0.3, 0.7) / theory - 1, 0.03));
}

TEST(Composite, LayersInSeriesUnderTension) {
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    const Vec3 size(0.08, 0.006, 0.004);
    Scene s = layered(size, 0, Vec3(0.5 * size.x(), -1, -1), Vec3::Ones());
    for (Material& m : s.materials) m.law = law;
    MpmTissue tissue(s);
    pull(tissue, 0, 0, 1e-3 * size.x());
    expect_series(tissue, 0, 0, {4e3, 16e3});
  }
}

TEST(Composite, LayersInSeriesUnderShear) {
  const Vec3 size(0.2, 0.002, 0.048);
  Scene s = layered(size, 0.3, Vec3(-1, -1, 0.5 * size.z()), Vec3::Ones());
  MpmTissue tissue(s);
  pull(tissue, 2, 0, 1e-3 * size.z());
  const double shear = std::sqrt(3.0) / 2.6;  // of E: von Mises stress over the angle
  expect_series(tissue, 2, 0, {shear * 4e3, shear * 16e3});
}

/// Layers side by side are strained alike and share the load by their stiffness (Voigt).
TEST(Composite, LayersInParallel) {
  const Vec3 size(0.08, 0.012, 0.004);
  Scene s = layered(size, 0, Vec3(-1, 0.004, -1), Vec3(1, 0.008, 1));
  MpmTissue tissue(s);
  pull(tissue, 0, 0, 1e-3 * size.x());
  const At a = plane(tissue, 0, 0.4, 0), b = plane(tissue, 0, 0.6, 0);
  const double strain = (b.moved.x() - a.moved.x()) / (b.home.x() - a.home.x());
  EXPECT_NEAR(plane(tissue, 0, 0.5, 0).stress / strain, (4e3 * 2 + 16e3) / 3, 1e-3 * 8e3);
  for (const At& p : points_of(tissue)) {
    if (std::fabs(p.home.x() - 0.5 * size.x()) > 0.001) continue;
    const double modulus = std::fabs(p.home.y() - 0.006) < 0.002 ? 16e3 : 4e3;
    EXPECT_TRUE(is_within("layers side by side: stress", p.stress / strain / modulus - 1, 2e-3))
        << p.home.transpose();
  }
}

/// Half a block of the density 1000, half of 3000 kg/m^3.
Scene two_densities() {
  Scene s = layered(Vec3(0.032, 0.012, 0.01), 0.3, Vec3(0.016, -1, -1), Vec3::Ones());
  s.damping = 0;
  s.materials[0].density = 1000;
  s.materials[1].density = 3000;
  return s;
}

TEST(Composite, HasTheMassOfItsParts) {
  MpmTissue tissue(two_densities());
  const MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  double mass = 0;
  Vec3 center = Vec3::Zero();
  for (std::size_t i = 0; i < home.size(); ++i) {
    mass += s.nodes.mass[i];
    center += s.nodes.mass[i] * home[i];
  }
  const double half = 0.016 * 0.012 * 0.01;
  EXPECT_NEAR(mass, 4000 * half, 1e-6 * mass);
  EXPECT_LT((center / mass - Vec3((0.008 + 3 * 0.024) / 4, 0.006, 0.005)).norm(), 1e-7);
}

TEST(Composite, FallsAllAtOnce) {
  Scene s = two_densities();
  s.gravity = Vec3(0, 0, -9.81);
  MpmTissue tissue(s);
  const float dt = tissue.stable_substep();
  advance_by(tissue, 100, dt, {});
  const FrameResult r = tissue.finish();
  EXPECT_NEAR(r.max_speed, 9.81 * 100 * dt, 1e-5 * r.max_speed);
  EXPECT_LT(r.elastic_energy, 1e-9 * r.kinetic_energy);
}

TEST(Composite, KeepsItsMomentumWholeAndCut) {
  MpmTissue tissue(two_densities());
  MpmState& s = tissue.state();
  std::vector<Vec3> home = homes(s);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 from = home[i] - Vec3(0.016, 0.006, 0.005);
    const Vec3 v = Vec3(0.2, -0.1, 0.3) + Vec3(1, -2, 3).cross(from) + 20 * from.x() * from;
    for (int a = 0; a < 3; ++a) s.nodes.v[a][i] = static_cast<float>(v[a]);
  }
  const Momentum before = momentum(s);
  for (int i = 0; i < 10; ++i) {
    advance_by(tissue, 100, tissue.stable_substep(), {});
    tissue.finish();
    if (i == 4) cut_now(tissue, plane_cut(Vec3(0.016, 0.006, 0.005), Vec3(0.3, 1, 0.2)));
  }
  const Momentum after = momentum(s);
  EXPECT_LT((after.linear - before.linear).norm(), 3e-5 * before.linear.norm());
  EXPECT_LT((after.angular - before.angular).norm(), 3e-5 * before.angular.norm());
}

}  // namespace
}  // namespace tissue_sim
