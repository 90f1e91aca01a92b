// A cantilever that sags, over the spacing of its nodes: regular and graded. Small
// displacements, solved directly in double from the program's own weights and moments.
#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <cmath>

#include "mls/small_motion.h"
#include "support/beam_scene.h"
#include "support/curve_file.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

SmallMotion cantilever(const Beam& beam, MlsPlacement placement, int layers) {
  Scene scene = beam_scene(beam, layers / 2, true);
  scene.method = Method::kMls;
  scene.mls.spacing = beam.height / layers;
  scene.mls.placement = placement;
  return small_motion(scene);
}

/// Tip of the beam under its own weight over theory's.
double tip(MlsPlacement placement, double nu, int layers) {
  const Beam beam = soft_beam(6, nu);
  const SmallMotion motion = cantilever(beam, placement, layers);
  const MlsState& s = motion.tissue->state();
  const std::vector<int>& number = motion.number;
  Eigen::VectorXd load = Eigen::VectorXd::Zero(motion.mass.size());
  for (Eigen::Index k = 2; k < load.size(); k += 3) load[k] = -motion.mass[k];
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(motion.stiffness);
  const Eigen::VectorXd u = solver.solve(load);
  // The end is straight: a line through the last quarter of the height.
  double n = 0, sx = 0, sz = 0, sxx = 0, sxz = 0;
  for (int i = 0; i < s.count(); ++i) {
    const double x = s.nodes.place[i].x() - beam.length;
    if (number[i] < 0 || x < -0.5 * beam.height) continue;
    const double w = s.mass[i], z = u[3 * number[i] + 2];
    n += w, sx += w * x, sz += w * z, sxx += w * x * x, sxz += w * x * z;
  }
  const double end = (sz * sxx - sx * sxz) / (n * sxx - sx * sx);
  return -end / tip_deflection(beam, 1);
}

std::string name_of_placement(const testing::TestParamInfo<MlsPlacement>& info) {
  constexpr const char* kNames[] = {"regular", "graded"};
  return kNames[static_cast<int>(info.param)];
}

class MlsConvergence : public testing::TestWithParam<MlsPlacement> {};
INSTANTIATE_TEST_SUITE_P(Each, MlsConvergence,
                         testing::Values(MlsPlacement::kRegular, MlsPlacement::kGraded),
                         name_of_placement);

// More layers with TISSUE_SIM_CURVES, some minutes.
TEST_P(MlsConvergence, OfACantileverOverTheSpacingOfItsNodes) {
  const bool all = std::getenv("TISSUE_SIM_CURVES") != nullptr;
  const std::string name = name_of_placement({GetParam(), 0});
  CurveFile file("mls_convergence_" + name, "layers,error nu 0,error nu 0.3");
  double coarse = 0, fine = 0;
  for (const int layers : all ? std::vector<int>{4, 6, 8, 12} : std::vector<int>{4, 8}) {
    const double error = tip(GetParam(), 0, layers) - 1;
    const double other = all || layers == 8 ? tip(GetParam(), 0.3, layers) - 1 : 0;
    file.add({static_cast<double>(layers), error, other});
    std::printf("%s, %d layers: %.4f; nu 0.3: %.4f\n", name.c_str(), layers, error, other);
    std::fflush(stdout);
    if (layers == 4) coarse = std::fabs(error);
    if (layers != 8) continue;
    fine = std::fabs(error);
    EXPECT_TRUE(is_within("sag over 8 layers, " + name + ", nu 0.3", other,
                          GetParam() == MlsPlacement::kGraded ? 0.05 : 0.03));
  }
  // Graded ones are up to twice as far apart inside.
  const double within = GetParam() == MlsPlacement::kGraded ? 0.05 : 0.03;
  EXPECT_TRUE(is_at_most("sag over 8 layers, " + name + ", nu 0", fine, within, "%"));
  EXPECT_LT(fine, coarse);
}

// Its first bending mode in the direction of its height, 8 nodes, by inverse iteration.
TEST(MlsVibration, OfACantileverIsTimoshenkos) {
  const Beam beam = soft_beam(8, 0.3);
  const SmallMotion motion = cantilever(beam, MlsPlacement::kRegular, 8);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(motion.stiffness);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(motion.mass.size());
  for (Eigen::Index k = 2; k < u.size(); k += 3) u[k] = 1;
  double omega = 0;
  for (int i = 0; i < 12; ++i) {
    const Eigen::VectorXd next = solver.solve(motion.mass.cwiseProduct(u));
    omega = std::sqrt(next.dot(motion.stiffness * next) / next.dot(motion.mass.cwiseProduct(next)));
    u = next / next.norm();
  }
  const double theory = bending_frequency(beam, Ends::kClampedFree);
  std::printf("first bending mode: %.4f of theory\n", omega / theory);
  EXPECT_TRUE(is_within("frequency of a cantilever", omega / theory - 1, 0.03));
}

}  // namespace
}  // namespace tissue_sim
