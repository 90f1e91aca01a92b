// Springs of supports that span no space, after cuts that come one after the other.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mls/cut.h"
#include "mls/linearised_motion.h"
#include "mls/mls_scenes.h"
#include "mls/substep_choice.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

/// What make_springs() is to give an entry [N/m].
double spring_of(const MlsState& s, std::int32_t i, std::int32_t entry) {
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const Vec3 r = s.nodes.place[s.pairs.other[e]] - s.nodes.place[i];
    moment += s.pairs.weight[e] * r * r.transpose();
  }
  const double weight = s.pairs.weight[entry];
  if (s.sprung[i] == 0 || weight == 0) return 0;
  const double stiffness = s.nodes.material_of(i).young_modulus * s.nodes.volume[i];
  return reference::spring_share(moment) * stiffness * weight / moment.trace();
}

// A sheet one node thick, pulled by a little while it narrows by a third as much: in the mean of
// all directions, for most of it is borne along the lattice.
TEST(MlsSprings, OfASheetBearWhatItsMaterialDoes) {
  MlsTissue tissue(mls_box(Vec3(0.03, 0.03, 0.002), 0.002));
  MlsState& s = tissue.state();
  std::int32_t middle = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    const auto from_middle = [&](std::int32_t n) {
      return (s.nodes.place[n] - Vec3(0.015, 0.015, 0.001)).norm();
    };
    if (from_middle(i) < from_middle(middle)) middle = i;
  }
  ASSERT_EQ(s.sprung[middle], 1);
  constexpr int kDirections = 16;
  double energy = 0;  // for a strain of 1: half of each spring is the other node's
  for (int k = 0; k < kDirections; ++k) {
    const double angle = M_PI * k / kDirections;
    const Vec3 x(std::cos(angle), std::sin(angle), 0), y(-x[1], x[0], 0);
    for (std::int32_t e = s.pairs.begin[middle]; e < s.pairs.begin[middle + 1]; ++e) {
      const Vec3 r = s.nodes.place[s.pairs.other[e]] - s.nodes.place[middle];
      const double longer = (std::pow(r.dot(x), 2) - std::pow(r.dot(y), 2) / 3) / r.norm();
      energy += 0.25 * (s.spring[e] + s.spring[s.pairs.twin[e]]) * longer * longer / kDirections;
    }
  }
  const double stiffness = s.nodes.material_of(middle).young_modulus * s.nodes.volume[middle];
  EXPECT_TRUE(
      is_within("strain energy of a sheet one node thick", energy / (0.5 * stiffness) - 1, 0.01));
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

// Of a heavy node that a cut leaves with a light one, as there are at a curved surface.
TEST(MlsSprings, SetTheSubstepWhereTheyAreTheFastest) {
  Scene scene = mls_box(Vec3::Constant(0.01), 0.001);
  scene.materials.push_back({});
  scene.materials.back().name = scene.bodies[0].material = "of little Poisson's ratio";
  scene.materials.back().poisson_ratio = 0;
  scene.bodies[0].shape = Shape::kEllipsoid;
  scene.bodies[0].pose.position = Vec3::Zero();
  scene.bodies[0].radii = Vec3(0.0026, 0.0086, 0.0094);
  MlsTissue tissue(scene);
  MlsState& s = tissue.state();
  // What is left beside a cut counts as if it bore all that it bore before: some nodes look faster
  // than anything is.
  for (int cut = 0; cut < 4; ++cut) {
    tissue.cut_now(plane_cut(Vec3(0.0003, 0.0004, 0.0002), Vec3(0.2 * cut, 1, 0.3 - 0.4 * cut)));
  }
  MlsSubsteps substeps(s);
  const double frame = 1 / scene.frame_rate;
  const auto longest = [&] {
    return substeps
        .part(s, frame,
              [&](const std::vector<std::uint8_t>&, int) {
                return measured_limit(
                    s, [&](const float* u, float* force) { internal_forces(s, u, force); }, 8);
              })
        .longest();
  };
  const double before = longest();
  double most_own = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) most_own = std::max(most_own, own_rate(s, i));
  // The pair whose spring is the fastest when it is alone, of those that are not faster than any
  // node by its own strain: nodes together are not, either.
  std::int32_t node = 0, kept = 0;
  double most = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      const std::int32_t j = s.pairs.other[e];
      const double r2 = (s.nodes.place[j] - s.nodes.place[i]).squaredNorm();
      const double stiffness = s.nodes.material_of(i).young_modulus * s.nodes.volume[i] / r2;
      const double rate = stiffness * (s.inv_mass[i] + s.inv_mass[j]);
      if (s.pairs.crossed[e] == 0 && rate > most && rate < 0.99 * most_own) {
        most = rate;
        node = i;
        kept = e;
      }
    }
  }
  std::vector<std::int32_t> entries, changed;
  for (const std::int32_t i : {node, s.pairs.other[kept]}) {
    for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      if (e != kept && e != s.pairs.twin[kept]) entries.push_back(e);
    }
  }
  CutReport report;
  cross_entries(s, entries, {}, changed, report);
  substeps.cut(s, changed);
  ASSERT_NE(s.sprung[node], 0);
  const double limit = 2 / std::sqrt(own_rate(s, node) + own_rate(s, s.pairs.other[kept]));
  ASSERT_GT(before, limit) << "it is the fastest";
  EXPECT_LT(longest(), 0.9 * limit);
}

}  // namespace
}  // namespace tissue_sim
