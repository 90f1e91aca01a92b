// Fracture mechanics of a partial cut: how much more a strip gives for an edge crack.
#include <gtest/gtest.h>

#include "support/crack_strip.h"
#include "support/curve_file.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

// A crack ends where it was cut to, wherever that is in a cell, and adds to the compliance what
// fracture mechanics says.
TEST(EdgeCrack, IsAsDeepAsItWasCut) {
  CurveFile file("edge_crack", "deep,at_nodes,error,short_by");
  for (const int deep : {5, 10, 20}) {
    for (const bool at_nodes : {false, true}) {
      CrackStrip strip(deep, at_nodes);
      const double whole = pull(strip.tissue(false)->state(), 1).compliance;
      double before = 0, share_before = 0;
      for (const double cells : {0.0, 0.25, 0.5, 0.625, 0.875}) {
        if (deep == 20 && cells > 0.5) break;
        const double depth = (deep + cells) * strip.cell_size;
        const auto tissue = strip.tissue(true, depth);
        const double added = pull(tissue->state(), 1).compliance - whole;
        const double theory =
            crack_compliance(strip.young_modulus, strip.cell_size, depth / strip.width);
        EXPECT_TRUE(is_within("compliance of an edge crack " + std::to_string(deep) + " cells deep",
                              added / theory - 1,
                              deep == 5    ? 0.06
                              : deep == 10 ? 0.025
                                           : 0.015))
            << cells;
        const double share = effective_share(strip.young_modulus, strip.cell_size, added);
        EXPECT_NEAR(share * strip.width, depth, 0.08 * strip.cell_size);
        file.add({deep + cells, at_nodes ? 1.0 : 0.0, added / theory - 1,
                  (depth - share * strip.width) / strip.cell_size});
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
  for (const double cells : {0.0, 0.4}) {
    const CrackStrip strip(10);
    const auto tissue = strip.tissue(true, 0.02 + cells * strip.cell_size);
    MpmState& s = tissue->state();
    const PulledStrip rest = pull(s, 5e-5 * strip.young_modulus);
    double largest = 0;
    for (std::size_t i = 0; i < s.nodes.size(); ++i) {
      for (int a = 0; a < 3; ++a) s.nodes.u[a][i] = static_cast<float>(rest.u[i][a]);
      largest = std::max(largest, rest.load[i].norm());
    }
    ASSERT_FALSE(s.front.nodes.empty());
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
  for (const double share : {0.2, 0.35, 0.6}) {
    const auto tissue = strip.tissue(true, share * strip.width);
    const double added = pull(tissue->state(), 1).compliance - whole;
    const double theory = crack_compliance(strip.young_modulus, strip.cell_size, share);
    EXPECT_TRUE(is_within("compliance, 0.2 to 0.6 of the width deep", added / theory - 1, 0.02))
        << share;
  }
}

}  // namespace
}  // namespace tissue_sim
