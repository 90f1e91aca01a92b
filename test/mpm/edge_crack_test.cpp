// Fracture mechanics of a partial cut: how much more a strip gives for an edge crack.
#include <gtest/gtest.h>

#include <cstdlib>

#include "crack_strip.h"
#include "curve_file.h"

namespace tissue_sim {
namespace {

/// What the crack adds to the compliance, against fracture mechanics.
struct Added {
  double error;     ///< relative
  double short_by;  ///< of the crack length that would add so much [cells]
};

Added measure(const CrackStrip& strip) {
  const auto whole = strip.tissue(false), cracked = strip.tissue(true);
  const double added = pull(cracked->state(), 1).compliance - pull(whole->state(), 1).compliance;
  const double thickness = strip.cell_size;
  const double theory = crack_compliance(strip.young_modulus, thickness, 0.5);
  const double share = effective_share(strip.young_modulus, thickness, added);
  return {added / theory - 1, (0.5 - share) * strip.width / strip.cell_size};
}

TEST(EdgeCrack, AddsTheComplianceOfFractureMechanicsAtFirstOrder) {
  CurveFile file("edge_crack", "deep,error,short_by,error_at_nodes,short_by_at_nodes");
  std::vector<int> resolutions = {10, 20};
  if (std::getenv("TISSUE_SIM_CURVES") != nullptr) resolutions = {5, 10, 20, 40};
  double coarser = 0;
  for (const int deep : resolutions) {
    const Added between = measure(CrackStrip(deep));
    const Added at_nodes = measure(CrackStrip(deep, true));
    file.add({1.0 * deep, between.error, between.short_by, at_nodes.error, at_nodes.short_by});
    for (const Added& crack : {between, at_nodes}) {
      EXPECT_LT(std::abs(crack.error), deep >= 20 ? 0.15 : 0.4) << deep << " cells deep";
      // The same half cell at every resolution: an error of first order.
      EXPECT_NEAR(crack.short_by, 0.5, 0.04) << deep << " cells deep";
    }
    if (coarser != 0) {
      EXPECT_NEAR(between.error / coarser, 0.5, 0.07) << deep << " cells deep";
    }
    coarser = between.error;
  }
}

TEST(EdgeCrack, StandsStillInTheProgramWhereTheDirectSolutionPutsIt) {
  const CrackStrip strip(10);
  const auto tissue = strip.tissue(true);
  MpmState& s = tissue->state();
  const PulledStrip rest = pull(s, 1e-4 * strip.young_modulus);
  double largest = 0;
  for (std::size_t i = 0; i < s.nodes.size(); ++i) {
    for (int a = 0; a < 3; ++a) s.nodes.u[a][i] = static_cast<float>(rest.u[i][a]);
    largest = std::max(largest, rest.load[i].norm());
  }
  const float dt = 1e-6f;
  std::vector<ColliderLoad> loads(s.colliders.size());
  substep(s, dt, loads);
  for (std::size_t i = 0; i < s.nodes.size(); ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;
    const Vec3 v(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    const Vec3 force = s.nodes.mass[i] * v / dt;
    ASSERT_LT((force + rest.load[i]).norm(), 0.01 * largest) << "node " << i;
  }
}

TEST(EdgeCrack, WeighsMoreTheDeeperItIs) {
  const CrackStrip strip(20);
  const double whole = pull(strip.tissue(false)->state(), 1).compliance;
  const double half_cell = 0.5 * strip.cell_size;
  for (const double share : {0.2, 0.35, 0.6}) {
    const auto tissue = strip.tissue(true, share * strip.width);
    const double added = pull(tissue->state(), 1).compliance - whole;
    const double theory =
        crack_compliance(strip.young_modulus, strip.cell_size, share - half_cell / strip.width);
    EXPECT_NEAR(added / theory, 1, 0.02) << share << " of the width";
  }
}

}  // namespace
}  // namespace tissue_sim
