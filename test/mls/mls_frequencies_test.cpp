// The lowest frequencies of a short free bar against finite elements (scripts/make_references).
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <string>

#include "mls/small_motion.h"
#include "support/finite_element_scenes.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

constexpr int kRigid = 6, kModes = 30;

/// The lowest frequencies above those of rigid motion [Hz], by subspace iteration.
Eigen::VectorXd frequencies(const SmallMotion& motion) {
  // What is free has no inverse: a shift of (2 pi 5 Hz)^2 makes one and leaves the modes.
  const double shift = std::pow(2 * M_PI * 5, 2);
  Eigen::SparseMatrix<double> shifted = motion.stiffness;
  shifted.diagonal() += shift * motion.mass;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(shifted);
  const int n = static_cast<int>(motion.mass.size()), columns = kRigid + kModes + 24;
  std::srand(1);
  Eigen::MatrixXd u = Eigen::MatrixXd::Random(n, columns);
  Eigen::VectorXd values;
  for (int i = 0; i < 8; ++i) {
    const Eigen::MatrixXd next = solver.solve(motion.mass.asDiagonal() * u);
    const Eigen::MatrixXd stiffness = next.transpose() * (shifted * next),
                          mass = next.transpose() * (motion.mass.asDiagonal() * next);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> reduced(stiffness, mass);
    u = next * reduced.eigenvectors();
    values = reduced.eigenvalues().array() - shift;
  }
  return values.segment(kRigid, kModes).cwiseMax(0).cwiseSqrt() / (2 * M_PI);
}

void compare(MlsPlacement placement) {
  Scene scene = reference_scene(0.005);
  scene.method = Method::kMls;
  scene.gravity = Vec3::Zero();
  scene.materials[0].poisson_ratio = 0.3;
  scene.bodies[0].size = Vec3(0.05, 0.02, 0.02);
  scene.mls.spacing = 0.0025;
  scene.mls.placement = placement;
  scene.mls.grading = 1;
  const Eigen::VectorXd read = frequencies(small_motion(scene));
  double least = 1, most = -1;
  for (int i = 0; i < kModes; ++i) {
    const double error = read[i] / reference(TISSUE_SIM_TEST_DATA, "free_bar",
                                             "frequency_" + std::to_string(i + 1)) -
                         1;
    least = std::min(least, error);
    most = std::max(most, error);
  }
  std::printf("errors of the lowest %d frequencies: %.2f to %.2f %%\n", kModes, 100 * least,
              100 * most);
  for (const double error : {least, most}) {
    EXPECT_TRUE(is_within(
        placement == MlsPlacement::kRegular ? "30 lowest frequencies of a bar" : "the same, graded",
        error, 0.1));
  }
}

// 20 x 8 x 8 nodes.
TEST(MlsFrequencies, OfAShortBarAreThoseOfFiniteElements) { compare(MlsPlacement::kRegular); }
TEST(MlsFrequencies, OfAShortBarOfScatteredNodesToo) { compare(MlsPlacement::kGraded); }

}  // namespace
}  // namespace tissue_sim
