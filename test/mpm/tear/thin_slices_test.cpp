// What becomes of slices a few points thick, and of a body that many cuts shatter.
#include <gtest/gtest.h>

#include <random>

#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.002, kSpacing = kCell / 2;  // of the lattice of points [m]
const Vec3 kSize(0.016, 0.008, 0.008);

/// Two slices, standing and lying, `spacings` thick, and what is left between them.
std::vector<BladePath> slices(int spacings) {
  return {plane_cut(Vec3(0.012, 0, 0), Vec3::UnitX()),
          plane_cut(Vec3(0.012 - spacings * kSpacing, 0, 0), Vec3::UnitX()),
          plane_cut(Vec3(0, 0, 0.008 - spacings * kSpacing), Vec3::UnitZ())};
}

/// Kinetic, elastic and potential energy [J].
double energy(Tissue& tissue, const FrameResult& r, double density, double gravity) {
  double total = r.kinetic_energy + r.elastic_energy;
  for (const Fragment& f : tissue.fragments()) {
    total += density * f.volume * gravity * f.centroid.z();
  }
  return total;
}

/// Cut where it stands, then left alone: nothing blows up, and energy only gets lost.
void rest_on_the_ground(const std::vector<BladePath>& cuts, std::size_t pieces, int frames) {
  Scene scene = free_box(kSize, kCell);
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  Simulation simulation(scene);
  Tissue& tissue = simulation.tissue();
  const double density = find_material(scene, "liver").density;
  const double at_first = density * kSize.prod() * 9.81 * kSize.z() / 2;
  for (const BladePath& cut : cuts) simulation.cut(cut);
  for (int frame = 0; frame < frames; ++frame) {
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up) << "frame " << frame;
    const double now = energy(tissue, report.result, density, 9.81);
    // What bounces off the ground leaves energy in its springs for a while: never more than at
    // first.
    ASSERT_TRUE(
        is_at_most("slices of a cut body at rest: energy over its first", now / at_first, 1.01))
        << "frame " << frame;
    ASSERT_LT(report.result.max_speed, 1) << "frame " << frame;
  }
  EXPECT_EQ(tissue.fragments().size(), pieces);
  double volume = 0;
  for (const Fragment& f : tissue.fragments()) {
    volume += f.volume;
    EXPECT_GT(f.box.min.z(), -0.5 * kCell) << "piece " << f.id << " sank";
    EXPECT_LT((f.centroid - 0.5 * kSize).norm(), 0.5) << "piece " << f.id << " flew away";
  }
  EXPECT_NEAR(volume, kSize.prod(), 1e-6 * kSize.prod());
}

TEST(ThinSlices, OfThreeTwoAndOneSpacingsLieStillOnTheGround) {
  for (const int spacings : {3, 2, 1}) {
    SCOPED_TRACE(spacings);
    rest_on_the_ground(slices(spacings), 6, 60);
  }
}

TEST(ThinSlices, AreAsThickAsTheyWereCut) {
  for (const int spacings : {3, 2, 1}) {
    MpmTissue tissue(free_box(kSize, kCell));
    for (const BladePath& cut : slices(spacings)) cut_now(tissue, cut);
    const int top = spacings * 8, rest = (8 - spacings) * 8;
    std::vector<int> expected = {4 * top,  (12 - spacings) * top,  spacings * top,
                                 4 * rest, (12 - spacings) * rest, spacings * rest};
    std::sort(expected.rbegin(), expected.rend());
    EXPECT_EQ(piece_sizes(tissue), expected) << spacings << " spacings";
  }
}

TEST(ThinSlices, AndDebrisKeepTheirMomentumAndGainNoEnergyInFlight) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<BladePath> shatter;
  for (int i = 0; i < 12; ++i) {
    const Vec3 place =
        0.5 * kSize + 0.45 * Vec3(u(random), u(random), u(random)).cwiseProduct(kSize);
    shatter.push_back(plane_cut(place, Vec3(u(random), u(random), u(random))));
  }
  for (const std::vector<BladePath>& cuts : {slices(3), slices(2), slices(1), shatter}) {
    MpmTissue tissue(free_box(kSize, kCell));
    MpmState& s = tissue.state();
    std::vector<Vec3> home = homes(s);
    for (std::size_t i = 0; i < home.size(); ++i) {
      const Vec3 X = home[i] - 0.5 * kSize;
      const Vec3 v = Vec3(0.2, -0.1, 0.3) + Vec3(5, 8, X.x() > 0 ? 12 : -6).cross(X);
      for (int a = 0; a < 3; ++a) s.nodes.v[a][i] = static_cast<float>(v[a]);
    }
    measure_motion(s);
    advance_by(tissue, 200, tissue.stable_substep(), {});
    const FrameResult before = tissue.finish();
    const Momentum start = momentum(s);
    advance_by(tissue, 0, 0, {{}, {cuts}});
    const FrameResult after = tissue.finish();
    const double energy = before.kinetic_energy + before.elastic_energy;
    EXPECT_NEAR(after.kinetic_energy + after.elastic_energy, energy, 0.01 * energy);
    double largest = 0;
    for (int i = 0; i < 10; ++i) {
      advance_by(tissue, 200, tissue.stable_substep(), {});
      const FrameResult now = tissue.finish();
      ASSERT_FALSE(now.blew_up);
      largest = std::max(largest, now.kinetic_energy + now.elastic_energy);
    }
    EXPECT_TRUE(is_at_most("slices, debris in flight: energy", largest / energy, 1.02))
        << tissue.fragments().size() << " pieces";
    const Momentum end = momentum(s);
    EXPECT_TRUE(is_at_most("their linear momentum",
                           (end.linear - start.linear).norm() / start.linear.norm(), 3e-5));
    EXPECT_TRUE(is_at_most("their angular momentum",
                           (end.angular - start.angular).norm() / start.angular.norm(), 3e-5));
  }
}

TEST(ThinSlices, ABodyThatIsShatteredIntoDebrisStaysFiniteOnTheGround) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<BladePath> shatter;
  for (int i = 0; i < 18; ++i) {
    const Vec3 place =
        0.5 * kSize + 0.45 * Vec3(u(random), u(random), u(random)).cwiseProduct(kSize);
    shatter.push_back(plane_cut(place, Vec3(u(random), u(random), u(random))));
  }
  MpmTissue tissue(free_box(kSize, kCell));
  for (const BladePath& cut : shatter) cut_now(tissue, cut);
  rest_on_the_ground(shatter, tissue.fragments().size(), 20);
}

}  // namespace
}  // namespace tissue_sim
