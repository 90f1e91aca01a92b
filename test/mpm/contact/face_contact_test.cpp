// Tissue against tissue: faces of cuts, pieces that collide, scrape and part. On the CPU and, where
// there is one, on the GPU.
#include <gtest/gtest.h>

#include "mpm/contact/face_places.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"

namespace tissue_sim {
namespace {

template <class T>
class FaceContactOf : public OnEitherDevice<T> {};
TYPED_TEST_SUITE(FaceContactOf, Tissues, DeviceName);

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

/// What each of two pieces gets, by number: the left one and the right one.
template <class T>
std::vector<Vec3> left_and_right(T& tissue, const Vec3& left, const Vec3& right) {
  const Span<const Fragment> pieces = tissue.fragments();
  if (pieces[0].centroid[0] < pieces[1].centroid[0]) return {left, right};
  return {right, left};
}

/// Force of the strongest contact [N].
double strongest(const MpmState& s) {
  float largest = 0;
  for (const std::int32_t i : s.faces.active) {
    largest = std::max(largest, dot(s.faces.all[i].force, s.faces.all[i].force));
  }
  return std::sqrt(static_cast<double>(largest));
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
    advance_by(tissue, 1, 1e-6f, {});
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
  const std::vector<Vec3> velocity =
      left_and_right(tissue, Vec3(0.15, 0.1, 0), Vec3(-0.15, -0.1, 0.05));
  throw_pieces(tissue, velocity, Vec3(2, 1, 3));
  MpmState& s = tissue.state();
  const Momentum start = momentum(s);
  advance_by(tissue, 0, 1e-4f, {});
  double energy = total(tissue.finish());
  const double first = energy;
  int most = 0;
  for (int f = 0; f < 20; ++f) {
    const FrameResult r = advance_frame(tissue);
    pull(tissue);
    const Momentum now = momentum(s);
    EXPECT_TRUE(is_at_most("pieces collide and scrape: linear momentum",
                           (now.linear - start.linear).norm() / start.linear.norm(), 3e-5));
    EXPECT_TRUE(is_at_most("their angular momentum",
                           (now.angular - start.angular).norm() / start.angular.norm(), 3e-5));
    // Velocities are half a substep behind: what rings seems to swing by a percent or two.
    EXPECT_TRUE(is_at_most("their energy over its least before", total(r) / energy, 1.02))
        << "frame " << f;
    energy = std::min(energy, total(r));
    most = std::max(most, touching(s));
  }
  EXPECT_GT(most, 20) << "they do collide";
  EXPECT_LT(energy, 0.9 * first) << "and scrape";
}

/// The largest k dt^2 / m of all springs, m being the mass that each moves.
double stiffest(const MpmState& s, float dt) {
  double largest = 0;
  for (const FaceContact& c : s.faces.all) {
    if (c.other < 0) continue;
    const double moves =
        mobility(s.nodes, c.nodes, c.weights) + mobility(s.nodes, c.other_nodes, c.other_weights);
    largest = std::max(largest, c.stiffness * double(dt) * dt * moves);
  }
  return largest;
}

TYPED_TEST(FaceContactOf, SpringsAreSoftEnoughForSubstepsThatGrowLonger) {
  for (const int before : {40, 43, 46, 49, 52}) {  // where looks are due, and between two
    Scene scene = inviscid(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
    TypeParam tissue(scene);
    cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3(1, 0.3, 0.1)));
    const std::vector<Vec3> velocity = left_and_right(tissue, Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0));
    throw_pieces(tissue, velocity, Vec3::Zero());
    const float dt = tissue.stable_substep(), shorter = dt / 8;
    advance_by(tissue, before, shorter, {});
    tissue.finish();
    pull(tissue);
    EXPECT_GT(touching(tissue.state()), 20);
    EXPECT_LT(stiffest(tissue.state(), shorter), 0.4);
    EXPECT_GT(stiffest(tissue.state(), dt), 0.5) << "else nothing is seen";
    advance_by(tissue, 1, dt, {});
    tissue.finish();
    pull(tissue);
    EXPECT_LT(stiffest(tissue.state(), dt), 0.4) << "after " << before;
  }
}

TYPED_TEST(FaceContactOf, NeverPulls) {
  TypeParam tissue(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3::UnitX()));
  const std::vector<Vec3> velocity = left_and_right(tissue, Vec3(0.1, 0, 0), Vec3(-0.1, 0, 0));
  throw_pieces(tissue, velocity, Vec3::Zero());
  const MpmState& s = tissue.state();
  const float dt = tissue.stable_substep();
  bool touched = false;
  for (int i = 0; i < 200; ++i) {
    advance_by(tissue, 1, dt, {});
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

/// Cells between two pieces see nodes of both, and a law may make no number of how far apart they
/// are.
TYPED_TEST(FaceContactOf, PiecesFarApartAreNoMatter) {
  TypeParam tissue(free_box(Vec3(0.03, 0.03, 0.03), 0.0015));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.0151, 0.0151), Vec3(1, 0.6, 0.3)));
  ASSERT_EQ(tissue.fragments().size(), 2u);
  pull(tissue);
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> size(-1, 3);
  for (int i = 0; i < 200; ++i) {
    const auto any = [&] { return Vec3(normal(random), normal(random), normal(random)); };
    const Vec3 apart = std::pow(10, size(random)) * any().normalized();  // [m]
    const Quat turn(Eigen::AngleAxisd(normal(random), any().normalized()));
    for (int a = 0; a < 3; ++a) std::fill(s.nodes.v[a].begin(), s.nodes.v[a].end(), 0.0f);
    for (int p = 0; p < s.points.size(); ++p) {
      if (tissue.fragment_of(p) == 0) continue;
      for (int k = 0; k < 27; ++k) {
        const int node = s.fields->node(s.bodies[0], s.points.site[p], k);
        const Vec3 u = turn * home[node] - home[node] + apart;
        for (int a = 0; a < 3; ++a) s.nodes.u[a][node] = static_cast<float>(u[a]);
      }
    }
    push(tissue);
    advance_by(tissue, 1, 1e-6f, {});
    const FrameResult r = tissue.finish();
    ASSERT_TRUE(std::isfinite(r.kinetic_energy)) << apart.transpose();
  }
}

TYPED_TEST(FaceContactOf, PiecesPressedTogetherPartWithoutResistance) {
  TypeParam tissue(free_box(Vec3(0.03, 0.02, 0.02), 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3(1, 0.2, 0)));
  throw_pieces(tissue, {Vec3(0.1, 0, 0), Vec3(0.1, 0, 0)}, Vec3::Zero());
  advance(tissue, 0.05);  // side by side
  const std::vector<Vec3> velocity = left_and_right(tissue, Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0));
  throw_pieces(tissue, velocity, Vec3::Zero());
  advance_by(tissue, 0, 1e-4f, {});
  const FrameResult before = tissue.finish();
  const FrameResult after = advance(tissue, 0.1);
  pull(tissue);
  EXPECT_EQ(touching(tissue.state()), 0);
  EXPECT_TRUE(
      is_within("pressed together, thrown apart: energy", total(after) / total(before) - 1, 3e-3));
  for (int p = 0; p < 2; ++p) {
    EXPECT_NEAR(tissue.fragments()[p].velocity[0], velocity[p][0], 1e-3);
  }
}

}  // namespace
}  // namespace tissue_sim
