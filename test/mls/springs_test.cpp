// Springs of supports that span no space, after cuts that come one after the other.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mls/mls_scenes.h"

namespace tissue_sim {
namespace {

/// What make_springs() is to give an entry [N/m].
double spring_of(const MlsState& s, std::int32_t i, std::int32_t entry) {
  double trace = 0;
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    trace += s.pairs.weight[e] * (s.nodes.place[s.pairs.other[e]] - s.nodes.place[i]).squaredNorm();
  }
  const double weight = s.pairs.weight[entry];
  if (s.sprung[i] == 0 || weight == 0) return 0;
  return s.nodes.material_of(i).young_modulus * s.nodes.volume[i] * weight / trace;
}

// Where a cut passes, a support may span no space for a while and some again when more of it is
// gone: it must not keep its springs, least of all those across the cut.
TEST(MlsSprings, AreOfSprungNodesAloneWhateverWasCut) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const double edge = 0.018;
  MlsTissue tissue(mls_box(Vec3::Constant(edge), 0.0015));
  MlsState& s = tissue.state();
  int with_springs = 0, no_more_sprung = 0;
  std::vector<std::uint8_t> was(s.count(), 0);
  for (int cut = 0; cut < 12; ++cut) {
    const Vec3 through = Vec3::Constant(0.5 * edge) +
                         0.2 * edge * Vec3(normal(random), normal(random), normal(random));
    const Vec3 along(normal(random), normal(random), normal(random));
    tissue.cut_now(plane_cut(through, along));
    for (std::int32_t i = 0; i < s.count(); ++i) {
      no_more_sprung += was[i] != 0 && s.sprung[i] == 0;
      was[i] |= s.sprung[i];
      for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
        const double expected = spring_of(s, i, e);
        const double is = s.spring.empty() ? 0 : s.spring[e];
        ASSERT_NEAR(is, expected, 1e-5 * expected) << "node " << i << " after cut " << cut;
        with_springs += expected > 0;
      }
    }
  }
  EXPECT_GT(with_springs, 100);
  EXPECT_GT(no_more_sprung, 0);
}

}  // namespace
}  // namespace tissue_sim
