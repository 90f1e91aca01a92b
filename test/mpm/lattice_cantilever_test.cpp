// What the lattice makes of a cantilever, beyond what any method must (test/tissue).
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "cantilever.h"
#include "clamp_place.h"

namespace tissue_sim {
namespace {

Bend sag(double nu, int cells, const std::string& curve = "") {
  const Beam beam = soft_beam(8, nu);
  Scene scene = beam_scene(beam, cells, true);
  scene.mpm.boundary = MpmBoundary::kLattice;
  MpmTissue tissue(scene);
  return bend(scene, beam, clamp_place(tissue.state()), curve);
}

TEST(LatticeCantilever, IsClampedWhereTheTableOfTolerancesHasIt) {
  for (const int cells : {4, 6, 8}) {
    Scene scene = beam_scene(soft_beam(8, 0.3), cells, true);
    scene.mpm.boundary = MpmBoundary::kLattice;
    MpmTissue tissue(scene);
    EXPECT_NEAR(clamp_place(tissue.state()) / scene.cell_size, tolerances(Method::kMpm).clamp,
                1e-6);
  }
}

// At nu = 0 the clamp does not squeeze the section, so the theory is exact, and the only error left
// is the second moment of n cells' points: that of 2 n layers is short by 1 / (4 n^2).
TEST(LatticeCantilever, ConvergesAtSecondOrder) {
  CurveFile file("cantilever", "poisson ratio,cells,error,error from the region's end");
  sag(0.3, 8, "cantilever_shape");
  double error[3], squeezed[3];
  const int cells[3] = {4, 6, 8};
  for (int i = 0; i < 3; ++i) {
    for (const double nu : {0.0, 0.3}) {
      const Bend b = sag(nu, cells[i]);
      (nu == 0 ? error : squeezed)[i] = b.error();
      file.add({nu, static_cast<double>(cells[i]), b.error(), b.tip / b.nominal - 1});
    }
    EXPECT_NEAR(error[i], 1 / (4.0 * cells[i] * cells[i] - 1), 1.5e-3) << cells[i];
  }
  EXPECT_GT(error[0] / error[1], 1.9);  // (6 / 4)^2 = 2.25
  EXPECT_GT(error[0] / error[2], 3.4);  // (8 / 4)^2 = 4
  EXPECT_LT(std::fabs(squeezed[2] - squeezed[1]), 0.5 * std::fabs(squeezed[1] - squeezed[0]));
}

}  // namespace
}  // namespace tissue_sim
