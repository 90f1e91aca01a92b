// Tip deflection of a cantilever under its own weight against Timoshenko's theory.
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "beam_scene.h"
#include "curve_file.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

struct Bend {
  double tip;      ///< [m]
  double theory;   ///< with the length from where the clamp acts [m]
  double nominal;  ///< with the length from where the anchored region ends [m]
  double error() const { return tip / theory - 1; }
};

std::vector<Point> points_of(Simulation& simulation) {
  std::vector<std::uint8_t> cloud;
  std::vector<Point> points(simulation.tissue().read_points({}, cloud));
  std::memcpy(points.data(), cloud.data(), cloud.size());
  return points;
}

/// Mean of how far the points sank that lie between x = begin and end.
double sunk(const std::vector<Point>& rest, const std::vector<Point>& now, double begin,
            double end) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (rest[i].x < begin || rest[i].x > end) continue;
    sum += static_cast<double>(rest[i].z) - now[i].z;
    ++count;
  }
  return sum / count;
}

/// Lets the beam sink under a weight that bends it by 0.5 % of its length, with the drag that lets
/// the first mode settle soonest, until it stands still.
Bend bend(const Beam& beam, int cells, const std::string& curve = "") {
  Scene scene = beam_scene(beam, cells, true);
  const double gravity = 0.005 * beam.length / tip_deflection(beam, 1);
  const double frequency = bending_frequency(beam, Ends::kClampedFree);
  scene.gravity = Vec3(0, 0, -gravity);
  scene.damping = 2 * frequency;
  scene.frame_rate = 4 * frequency;
  scene.cfl = 0.8;
  Simulation simulation(scene);
  Beam acting = beam;
  acting.length -= clamp_place(dynamic_cast<MpmTissue&>(simulation.tissue()).state());
  const std::vector<Point> rest = points_of(simulation);
  for (int i = 0; i < 56; ++i) simulation.advance_frame();  // (1 + 14) exp(-14) = 1e-5
  const std::vector<Point> now = points_of(simulation);

  const double h = scene.cell_size, end = beam.length;
  CurveFile file(curve, "x [m],sunk [m]");
  for (double x = -beam.height; x < end - h / 4; x += h / 2) {
    file.add({x + h / 4, sunk(rest, now, x, x + h / 2)});
  }
  // The last two layers of points lie 1/4 and 3/4 of a cell before the free end.
  const double last = sunk(rest, now, end - h / 2, end),
               other = sunk(rest, now, end - h, end - h / 2);
  return {last + (last - other) / 2, tip_deflection(acting, gravity),
          tip_deflection(beam, gravity)};
}

TEST(Cantilever, TheoryIsTheTextbooks) {
  const Beam b{2, 0.1, 0.05, 1e9, 0.25, 1000};  // w = 50 N/m, EI = 4166.7 N m^2
  EXPECT_NEAR(tip_deflection(b, 10), 0.024 + 5.9e-5, 1e-6);
}

TEST(Cantilever, SagsAsTimoshenkoSays) {
  for (double nu : {0.0, 0.3}) {
    const Bend b = bend(soft_beam(8, nu), 8, nu == 0 ? "" : "cantilever_shape");
    EXPECT_NEAR(b.error(), 0, 0.03) << nu;
    EXPECT_NEAR(b.tip / b.nominal, 1, 0.03) << nu;
  }
}

// The clamp keeps the section from narrowing, which the theory of beams does not know: a part of
// what is missing here. Without a clamp: Vibration.NearlyIncompressibleBeamDoesNotLock.
TEST(Cantilever, NearlyIncompressible) {
  EXPECT_NEAR(bend(soft_beam(8, 0.49), 8).error(), 0, 0.05);
}

// At nu = 0 the clamp does not squeeze the section, so the theory is exact, and the only error left
// is the second moment of n cells' points: that of 2 n layers is short by 1 / (4 n^2).
TEST(Cantilever, ConvergesAtSecondOrder) {
  CurveFile file("cantilever", "poisson ratio,cells,error,error from the region's end");
  double error[3], squeezed[3];
  const int cells[3] = {4, 6, 8};
  for (int i = 0; i < 3; ++i) {
    for (const double nu : {0.0, 0.3}) {
      const Bend b = bend(soft_beam(8, nu), cells[i]);
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
