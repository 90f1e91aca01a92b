// Stress of the material laws, as formulas and through the lattice kernels.
#include "tissue_sim/material.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "compute/simd.h"
#include "material/laws.h"
#include "mpm/contact/block_contact.h"
#include "mpm/mpm_tissue.h"
#include "support/curve_file.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

template <class T>
using Mat = Eigen::Matrix<T, 3, 3, Eigen::RowMajor>;
using Matd = Mat<double>;

constexpr double kMu = 1000, kLambda = 4000;

template <class LawOf, class T>
Mat<T> stress(const Mat<T>& f, double mu = kMu, double lambda = kLambda) {
  Mat<T> p;
  tissue_sim::stress<LawOf>(f.data(), static_cast<T>(mu), static_cast<T>(lambda), p.data());
  return p;
}

std::mt19937& dice() {
  static std::mt19937 random(7);
  return random;
}

Matd random_rotation() {
  std::normal_distribution<double> normal;
  const Quat q(normal(dice()), normal(dice()), normal(dice()), normal(dice()));
  return q.normalized().toRotationMatrix();
}

Vec3 random_stretches(double low, double high) {
  std::uniform_real_distribution<double> exponent(std::log(low), std::log(high));
  return Vec3(std::exp(exponent(dice())), std::exp(exponent(dice())), std::exp(exponent(dice())));
}

Matd random_gradient(double low, double high) {
  return random_rotation() * random_stretches(low, high).asDiagonal() * random_rotation();
}

/// Nearest rotation to F: U V^T of its singular values, of which the smallest changes sign with det
/// F.
Matd nearest_rotation(const Matd& f) {
  const Eigen::JacobiSVD<Matd> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matd u = svd.matrixU();
  const Matd v = svd.matrixV();
  if (u.determinant() * v.determinant() < 0) u.col(2) *= -1;
  return u * v.transpose();
}

// --- analytic stresses, written down by hand
// ------------------------------------------------------

Matd uniaxial(double s) { return Vec3(s, 1, 1).asDiagonal(); }
Matd simple_shear(double g) {
  Matd f = Matd::Identity();
  f(0, 1) = g;
  return f;
}

/// Fixed corotated: R = I, J = s, cof F = diag(1, s, s).
Matd uniaxial_corotated(double s, double mu, double lambda) {
  return Vec3(2 * mu * (s - 1) + lambda * (s - 1), lambda * (s - 1) * s, lambda * (s - 1) * s)
      .asDiagonal();
}
/// Neo-Hookean: mu F + ((lambda + mu) (J - 1) - mu) cof F.
Matd uniaxial_neo_hookean(double s, double mu, double lambda) {
  const double c = (lambda + mu) * (s - 1) - mu;
  return Vec3(mu * s + c, mu + c * s, mu + c * s).asDiagonal();
}
/// Fixed corotated: J = 1; R turns by the angle with tan = g / 2 against the shear.
Matd shear_corotated(double g, double mu, double) {
  const double c = 1 / std::sqrt(1 + g * g / 4), s = g / 2 * c;
  Matd p = Matd::Zero();
  p(0, 0) = p(1, 1) = 2 * mu * (1 - c);
  p(0, 1) = 2 * mu * (g - s);
  p(1, 0) = 2 * mu * s;
  return p;
}
/// Neo-Hookean: J = 1, P = mu (F - cof F), and cof F has -g at 1, 0.
Matd shear_neo_hookean(double g, double mu, double) {
  Matd p = Matd::Zero();
  p(0, 1) = p(1, 0) = mu * g;
  return p;
}

struct LawCase {
  Law law;
  Matd (*uniaxial)(double, double, double);
  Matd (*shear)(double, double, double);
};
const LawCase kLaws[] = {{Law::kFixedCorotated, uniaxial_corotated, shear_corotated},
                         {Law::kNeoHookean, uniaxial_neo_hookean, shear_neo_hookean}};

template <class T>
Mat<T> stress_of(Law law, const Mat<T>& f) {
  return law == Law::kNeoHookean ? stress<NeoHookean>(f) : stress<FixedCorotated>(f);
}

TEST(Laws, UniaxialStretchAndSimpleShear) {
  for (const LawCase& c : kLaws) {
    for (double s : {0.4, 0.7, 0.95, 1.0, 1.05, 1.5, 2.5}) {
      const Matd expected = c.uniaxial(s, kMu, kLambda);
      EXPECT_TRUE(is_at_most(
          "laws against formulas by hand",
          (stress_of(c.law, uniaxial(s)) - expected).norm() / (expected.norm() + kMu), 1e-5))
          << s;
    }
    for (double g : {-1.5, -0.3, 0.01, 0.5, 2.0}) {
      const Matd expected = c.shear(g, kMu, kLambda);
      EXPECT_TRUE(is_at_most(
          "laws against formulas by hand",
          (stress_of(c.law, simple_shear(g)) - expected).norm() / (expected.norm() + kMu), 1e-5))
          << g;
    }
  }
}

template <class LawOf>
void stress_is_the_energys_gradient() {
  for (int i = 0; i < 50; ++i) {
    const Matd f = random_gradient(0.5, 2), p = stress<LawOf>(f);
    Matd slope;
    for (int k = 0; k < 9; ++k) {
      Matd up = f, down = f;
      up.data()[k] += 1e-5;
      down.data()[k] -= 1e-5;
      slope.data()[k] =
          (energy<LawOf>(up.data(), kMu, kLambda) - energy<LawOf>(down.data(), kMu, kLambda)) /
          2e-5;
    }
    EXPECT_TRUE(is_at_most("stress against the slope of the energy",
                           (slope - p).norm() / (p.norm() + kMu), 1e-7))
        << f;
  }
}

TEST(Laws, StressIsTheGradientOfTheEnergy) {
  stress_is_the_energys_gradient<FixedCorotated>();
  stress_is_the_energys_gradient<NeoHookean>();
}

TEST(Laws, AreObjective) {
  CurveFile file("objectivity", "law,turned,at rest");
  for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    double worst = 0, at_rest = 0;
    for (int i = 0; i < 500; ++i) {
      const Matd f = random_gradient(1.0 / 3, 3), r = random_rotation();
      const Mat<float> turned = stress_of<float>(law, (r * f).cast<float>());
      const Mat<float> p = stress_of<float>(law, f.cast<float>());
      worst = std::max(worst, (turned.cast<double>() - r * p.cast<double>()).norm() / p.norm());
      const Mat<float> free = stress_of<float>(law, r.cast<float>());
      at_rest = std::max<double>(at_rest, free.norm() / kMu);
      EXPECT_LT(stress_of<double>(law, r).norm() / kMu, 1e-13);
    }
    EXPECT_TRUE(is_at_most("P(RF) against R P(F), in float", worst, 1e-5));
    EXPECT_TRUE(is_at_most("P(R), in float", at_rest, 1e-5));
    file.add({law == Law::kNeoHookean ? 1.0 : 0.0, worst, at_rest});
  }
}

TEST(PolarDecomposition, AgreesWithSingularValues) {
  double worst[2] = {0, 0};
  for (int i = 0; i < 3000; ++i) {
    const Matd f = random_gradient(1.0 / 3, 3), r = nearest_rotation(f);
    Matd rd;
    rotation(f.data(), rd.data());
    Mat<float> rf;
    const Mat<float> ff = f.cast<float>();
    rotation(ff.data(), rf.data());
    worst[0] = std::max(worst[0], (rd - r).norm());
    worst[1] = std::max(worst[1], (rf.cast<double>() - r).norm());
  }
  EXPECT_TRUE(is_at_most("rotations against singular values, double", worst[0], 1e-5));
  EXPECT_TRUE(is_at_most("the same, float", worst[1], 2e-5));
}

// What is turned inside out along one axis is pushed back out along it.
TEST(Laws, PushBackWhatIsInverted) {
  for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    for (int i = 0; i < 500; ++i) {
      Vec3 s = random_stretches(0.5, 2);
      s[0] *= -1;
      const Matd left = random_rotation(), right = random_rotation();
      const Matd f = left * s.asDiagonal() * right;
      const Mat<float> p = stress_of<float>(law, f.cast<float>());
      ASSERT_TRUE(p.allFinite()) << f;
      EXPECT_LT((left.transpose() * p.cast<double>() * right.transpose())(0, 0), 0) << s;
    }
  }
}

TEST(VonMises, IsTheTextbooks) {
  for (int i = 0; i < 100; ++i) {
    const Matd f = random_gradient(0.5, 2), p = stress<NeoHookean>(f);
    const Matd cauchy = p * f.transpose() / f.determinant();
    const Matd deviator = cauchy - cauchy.trace() / 3 * Matd::Identity();
    const double expected = std::sqrt(1.5) * deviator.norm();
    EXPECT_NEAR(std::sqrt(von_mises_squared(f.data(), p.data())), expected, 1e-9 * expected);
  }
}

// --- the same through the kernels: a block whose nodes stand where F puts them
// --------------------

/// Mean first Piola-Kirchhoff stress from the nodes' forces: P = -1/V sum_i f_i X_i^T. Forces are
/// what a substep of one second from rest leaves as momentum.
Matd block_stress(MpmTissue& tissue, const Matd& f) {
  MpmState& state = tissue.state();
  const LatticeBody& b = state.bodies[0];
  Nodes& n = state.nodes;
  std::vector<Vec3> home(n.size());
  for (int z = -1; z <= b.nz; ++z) {
    for (int y = -1; y <= b.ny; ++y) {
      for (int x = -1; x <= b.nx; ++x) {
        const int i = b.node(x, y, z);
        home[i] = b.node_position(x, y, z);
        const Vec3 u = f * home[i] - home[i];
        for (int c = 0; c < 3; ++c) {
          n.u[c][i] = static_cast<float>(u[c]);
          n.v[c][i] = 0;
        }
      }
    }
  }
  const std::vector<float> u[3] = {{n.u[0].begin(), n.u[0].end()},
                                   {n.u[1].begin(), n.u[1].end()},
                                   {n.u[2].begin(), n.u[2].end()}};
  state.colliders.clear();
  find_near_colliders(state, {}, 0);
  std::vector<ColliderLoad> loads;
  substep(state, 1.0f, loads);
  Matd sum = Matd::Zero();
  double volume = 0;
  for (const float v : state.points.volume) volume += v;
  for (std::size_t i = 0; i < n.size(); ++i) {
    sum -= n.mass[i] * Vec3(n.v[0][i], n.v[1][i], n.v[2][i]) * home[i].transpose();
    for (int c = 0; c < 3; ++c) {
      n.v[c][i] = 0;
      n.u[c][i] = u[c][i];
    }
  }
  return sum / volume;
}

/// Von Mises stress of all points, as clouds show it: least and largest.
std::pair<float, float> shown_stress(MpmTissue& tissue) {
  std::vector<std::uint8_t> cloud;
  std::vector<Point> points(tissue.read_points({}, cloud));
  std::memcpy(points.data(), cloud.data(), cloud.size());
  const auto range =
      std::minmax_element(points.begin(), points.end(),
                          [](const Point& a, const Point& b) { return a.stress < b.stress; });
  return {range.first->stress, range.second->stress};
}

TEST(BlockStress, IsTheLaws) {
  for (const LawCase& c : kLaws) {
    Scene scene;
    scene.cell_size = 0.003;
    scene.gravity = Vec3::Zero();
    scene.ground.enabled = false;
    scene.materials.resize(1);
    scene.materials[0].law = c.law;
    scene.bodies.resize(1);
    scene.bodies[0].size = Vec3(0.0247, 0.018, 0.0135);  // some cells are not full
    MpmTissue tissue(scene);
    const double mu = lame_mu(scene.materials[0]), lambda = lame_lambda(scene.materials[0]);
    CurveFile file(c.law == Law::kNeoHookean ? "stress_neo_hookean" : "stress_corotated",
                   "kind,deformation,measured [Pa],law [Pa]");
    const auto check = [&](const Matd& f, const Matd& p, int kind, double at, int entry) {
      const Matd measured = block_stress(tissue, f);
      EXPECT_TRUE(is_at_most("stress of a block, stretch 0.5 to 2, shear to 1",
                             (measured - p).norm() / (p.norm() + mu), 1e-3, "%"))
          << at;
      const Matd cauchy = p * f.transpose() / f.determinant();
      const double mises = std::sqrt(1.5) * (cauchy - cauchy.trace() / 3 * Matd::Identity()).norm();
      const auto shown = shown_stress(tissue);
      EXPECT_NEAR(shown.first, mises, 1e-3 * mises + 1e-3 * mu) << at;
      EXPECT_NEAR(shown.second, mises, 1e-3 * mises + 1e-3 * mu) << at;
      file.add({static_cast<double>(kind), at, measured.data()[entry], p.data()[entry]});
    };
    for (double s = 0.5; s < 2.01; s += 0.125)
      check(uniaxial(s), c.uniaxial(s, mu, lambda), 0, s, 0);
    for (double g = -1; g < 1.01; g += 0.125) {
      check(simple_shear(g), c.shear(g, mu, lambda), 1, g, 1);
    }
  }
}

}  // namespace
}  // namespace tissue_sim
