// What makes cuts cheap finds the same as what is slow and plain.
#include <gtest/gtest.h>

#include <random>

#include "cutting/blade_sweep.h"
#include "geometry/near_grid.h"
#include "mls/crossing.h"
#include "mls/cut.h"
#include "mls_scenes.h"

namespace tissue_sim {
namespace {

constexpr MlsPlacement kPlacements[] = {MlsPlacement::kRegular, MlsPlacement::kJittered,
                                        MlsPlacement::kGraded};

BladePath some_cut(std::mt19937& random) {
  std::uniform_real_distribution<double> even(-1, 1);
  const Vec3 normal(even(random), even(random), even(random));
  BladePath path = plane_cut(Vec3(0.006, 0.005, 0.004) + 0.003 * normal, normal);
  // Some of them end within the body.
  path.poses.back().position =
      path.poses.front().position +
      (0.5 + 0.05 * even(random)) * (path.poses.back().position - path.poses.front().position);
  return path;
}

TEST(MlsCutSearch, FindsTheCrossedPairsThatALookAtEachFinds) {
  std::mt19937 random(4);
  for (const MlsPlacement placement : kPlacements) {
    MlsTissue tissue(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement));
    MlsState& s = tissue.state();
    std::normal_distribution<float> normal(0, 2e-4f);
    std::size_t all = 0;
    for (int k = 0; k < 4; ++k) {
      const Array<float> before = s.u;
      for (int i = 0; i < s.count(); ++i) {
        for (int a = 0; a < 3; ++a) s.u[4 * i + a] += normal(random);
      }
      const BladePath path = some_cut(random);
      std::vector<std::int32_t> found = find_crossed(s, path, before.data(), s.u.data());
      std::sort(found.begin(), found.end());
      std::vector<std::int32_t> expected;
      const auto at = [&](int i, const Array<float>& u) {
        return Vec3(Vec3(s.place[4 * i], s.place[4 * i + 1], s.place[4 * i + 2]) +
                    Vec3(u[4 * i], u[4 * i + 1], u[4 * i + 2]));
      };
      for (const SweepPart& part : sweep_parts(path)) {
        for (int i = 0; i < s.count(); ++i) {
          for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
            const int j = s.pairs.other[e];
            if (j < i || s.pairs.crossed[e] != 0) continue;
            const MovingSegment link =
                MovingSegment{at(i, before), at(j, before), at(i, s.u), at(j, s.u)}.during(
                    part.begin, part.end);
            if (edge_passes(part.edges[0], link)) expected.push_back(e);
          }
        }
      }
      std::sort(expected.begin(), expected.end());
      ASSERT_EQ(found, expected);
      all += found.size();
      std::vector<std::int32_t> changed;
      CutReport report;
      cross_entries(s, found, {}, changed, report);
    }
    EXPECT_GT(all, 100u);
  }
}

TEST(MlsCutSearch, PiecesByTheSpannerAreThoseOfAllPairs) {
  std::mt19937 random(5);
  for (const MlsPlacement placement : kPlacements) {
    MlsTissue tissue(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement));
    MlsState& s = tissue.state();
    // Both of its nodes list a pair of it.
    EXPECT_LT(s.spanner.entry.size(), 2 * 0.25 * s.pairs.other.size());
    for (int k = 0; k < 7; ++k) {
      UnionFind all(s.count()), linked = join_uncrossed(s);
      for (int i = 0; i < s.count(); ++i) {
        for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
          if (s.pairs.crossed[e] == 0) all.join(i, s.pairs.other[e]);
        }
      }
      for (int i = 0; i < s.count(); ++i) ASSERT_EQ(linked.root(i), all.root(i));
      tissue.cut_now(some_cut(random));
    }
    EXPECT_GT(tissue.fragment_count(), 2);
  }
}

TEST(NearGrid, FindsWhatIsNear) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> even(-1, 1);
  std::vector<Vec3> points;
  for (int i = 0; i < 500; ++i) points.push_back(Vec3(even(random), even(random), even(random)));
  points.push_back(Vec3(1e9, 0, -1e9));
  points.push_back(Vec3::Constant(std::nan("")));
  const NearGrid grid(points, 0.2);
  int in_cells = 0;
  for (const double radius : {0.05, 0.2, 0.7}) {
    for (int cell = 0; cell < grid.cells(); ++cell) {
      std::vector<int> around;
      grid.for_each_around(cell, radius, [&](std::int32_t p) { around.push_back(p); });
      std::sort(around.begin(), around.end());
      ASSERT_EQ(std::unique(around.begin(), around.end()), around.end());
      grid.for_each_in(cell, [&](std::int32_t own) {
        ++in_cells;
        for (int p = 0; p < static_cast<int>(points.size()); ++p) {
          if (!((points[p] - points[own]).squaredNorm() <= radius * radius)) continue;
          ASSERT_TRUE(std::binary_search(around.begin(), around.end(), p)) << p << ' ' << own;
        }
      });
    }
  }
  EXPECT_EQ(in_cells, 3 * static_cast<int>(points.size()));
}

}  // namespace
}  // namespace tissue_sim
