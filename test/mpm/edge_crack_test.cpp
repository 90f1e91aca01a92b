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

// With the true surface a crack ends where it was cut to, wherever that is in a cell.
TEST(EdgeCrack, IsAsDeepAsItWasCut) {
  for (const int deep : {5, 10, 20}) {
    for (const bool at_nodes : {false, true}) {
      CrackStrip strip(deep, at_nodes);
      strip.boundary = MpmBoundary::kSurface;
      const double whole = pull(strip.tissue(false)->state(), 1).compliance;
      double before = 0, share_before = 0;
      for (const double cells : {0.0, 0.25, 0.5, 0.625, 0.875}) {
        if (deep == 20 && cells > 0.5) break;
        const double depth = (deep + cells) * strip.cell_size;
        const auto tissue = strip.tissue(true, depth);
        const double added = pull(tissue->state(), 1).compliance - whole;
        const double theory =
            crack_compliance(strip.young_modulus, strip.cell_size, depth / strip.width);
        EXPECT_NEAR(added / theory, 1,
                    deep == 5    ? 0.06
                    : deep == 10 ? 0.025
                                 : 0.015)
            << deep << ' ' << cells;
        const double share = effective_share(strip.young_modulus, strip.cell_size, added);
        EXPECT_NEAR(share * strip.width, depth, 0.08 * strip.cell_size);
        if (before != 0) {  // and it grows as the cut does: no stairs
          const double grown = (share - share_before) * strip.width;
          EXPECT_NEAR(grown / (depth - before), 1, 0.25) << deep << ' ' << cells;
        }
        before = depth;
        share_before = share;
      }
    }
  }
}

TEST(EdgeCrack, StandsStillInTheProgramWhereTheDirectSolutionPutsIt) {
  for (const double cells : {-1.0, 0.0, 0.4}) {
    CrackStrip strip(10);
    if (cells >= 0) strip.boundary = MpmBoundary::kSurface;
    const auto tissue = strip.tissue(true, 0.02 + std::max(cells, 0.0) * strip.cell_size);
    MpmState& s = tissue->state();
    const PulledStrip rest = pull(s, (cells < 0 ? 1e-4 : 5e-5) * strip.young_modulus);
    double largest = 0;
    for (std::size_t i = 0; i < s.nodes.size(); ++i) {
      for (int a = 0; a < 3; ++a) s.nodes.u[a][i] = static_cast<float>(rest.u[i][a]);
      largest = std::max(largest, rest.load[i].norm());
    }
    ASSERT_EQ(s.front.nodes.empty(), cells < 0);
    for (std::size_t i = 0; i < rest.d.size(); ++i) {
      for (int a = 0; a < 3; ++a) s.front.d[a][i] = static_cast<float>(rest.d[i][a]);
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
    for (std::size_t i = 0; i < rest.d.size(); ++i) {
      const Vec3 rate(s.front.rate[0][i], s.front.rate[1][i], s.front.rate[2][i]);
      ASSERT_LT(s.front.nodes[i].mass * rate.norm() / dt, 0.01 * largest) << "parted node " << i;
    }
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
