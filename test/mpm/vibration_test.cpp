// Free vibration of a beam against Timoshenko's theory.
#include <gtest/gtest.h>

#include <vector>

#include "support/beam_scene.h"
#include "support/curve_file.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

struct Swing {
  double measured, theory;  ///< frequency [Hz]
  double stiffness() const { return measured * measured / (theory * theory); }
};

/// Starts the beam in its first mode, at a hundredth of its height, and takes the frequency from
/// the zero crossings of that mode's amplitude over three periods.
Swing swing(const Beam& beam, int cells, Ends ends, const std::string& curve, Law law) {
  Scene scene = beam_scene(beam, cells, ends == Ends::kClampedFree, law);
  MpmTissue tissue(scene);
  MpmState& state = tissue.state();
  const LatticeBody& b = state.bodies[0];
  Nodes& n = state.nodes;
  const double frequency = bending_frequency(beam, ends) / (2 * M_PI);

  std::vector<double> weight(n.size());
  double scale = 0;
  const double speed = 0.01 * beam.height * 2 * M_PI * frequency;
  for (int z = -1; z <= b.nz; ++z) {
    for (int y = -1; y <= b.ny; ++y) {
      for (int x = -1; x <= b.nx; ++x) {
        const int i = b.node(x, y, z);
        const Vec3 place = b.node_position(x, y, z);
        if (n.inv_mass[i] == 0 || place.x() < 0) continue;
        double slope;
        const double shape = mode_shape(ends, place.x() / beam.length, &slope);
        weight[i] = n.mass[i] * shape;
        scale += weight[i] * shape;
        n.v[2][i] = static_cast<float>(speed * shape);
        n.v[0][i] = static_cast<float>(-speed * slope / beam.length * place.z());
      }
    }
  }
  const double sample = 1 / (48 * frequency);
  const int substeps = static_cast<int>(std::ceil(sample / tissue.stable_substep()));
  const double dt = sample / substeps;
  CurveFile file(curve, "time [s],amplitude,theory");
  std::vector<double> crossings;
  double before = 0;
  for (int i = 1; i <= 48 * 3 + 8; ++i) {
    advance_by(tissue, substeps, static_cast<float>(dt), {});
    double amplitude = 0;
    for (std::size_t k = 0; k < weight.size(); ++k) amplitude += weight[k] * n.u[2][k];
    amplitude /= scale * 0.01 * beam.height;
    if (i > 1 && before * amplitude < 0) {
      crossings.push_back((i - 1 + before / (before - amplitude)) * sample);
    }
    file.add({i * sample, amplitude, std::sin(2 * M_PI * frequency * i * sample)});
    before = amplitude;
  }
  EXPECT_GE(crossings.size(), 6u);
  EXPECT_FALSE(tissue.finish().blew_up);
  return {0.5 * (crossings.size() - 1) / (crossings.back() - crossings.front()), frequency};
}

TEST(Vibration, TimoshenkoTendsToTheSlenderBeamAndShearSlowsIt) {
  for (Ends ends : {Ends::kFree, Ends::kClampedFree}) {
    const Beam slender = soft_beam(1000, 0.3), stout = soft_beam(8, 0.3);
    EXPECT_NEAR(bending_frequency(slender, ends) / slender_frequency(slender, ends), 1, 1e-4);
    EXPECT_LT(bending_frequency(stout, ends), 0.995 * slender_frequency(stout, ends));
  }
}

TEST(Vibration, FreeBeamKeepsTime) {
  for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    const bool first = law == Law::kFixedCorotated;
    const Swing s = swing(soft_beam(8, 0.3), 8, Ends::kFree,
                          first ? "vibration_free" : "vibration_free_neo_hookean", law);
    EXPECT_TRUE(is_within("frequency of a free beam", s.measured / s.theory - 1, 0.03));
    EXPECT_LT(s.measured, s.theory);  // midpoint quadrature and lumped masses: softer and heavier
  }
}

TEST(Vibration, CantileverKeepsTime) {
  const Swing s =
      swing(soft_beam(8, 0.3), 8, Ends::kClampedFree, "vibration_cantilever", Law::kFixedCorotated);
  EXPECT_TRUE(is_within("frequency of a cantilever", s.measured / s.theory - 1, 0.03));
}

// A locking discretisation bends stiffer, the more so the nearer nu comes to 1/2 and the coarser
// the cells. No clamp is in the way here, so what remains is the discretisation alone.
TEST(Vibration, NearlyIncompressibleBeamDoesNotLock) {
  CurveFile file("no_locking", "poisson ratio,cells,stiffness");
  for (int cells : {4, 6, 8}) {
    double compressible = 0;
    for (double nu : {0.0, 0.3, 0.45, 0.49}) {
      const Swing s = swing(soft_beam(6, nu), cells, Ends::kFree, "", Law::kFixedCorotated);
      file.add({nu, static_cast<double>(cells), s.stiffness()});
      EXPECT_TRUE(
          is_within("bending stiffness, 4 to 8 cells, nu 0 to 0.49", s.stiffness() - 1, 0.05))
          << nu << " " << cells;
      if (nu == 0) compressible = s.stiffness();
      EXPECT_TRUE(
          is_within("the same, less that at nu 0: no locking", s.stiffness() - compressible, 0.01))
          << nu << " " << cells;
    }
  }
}

}  // namespace
}  // namespace tissue_sim
