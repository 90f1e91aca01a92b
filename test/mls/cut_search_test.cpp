// What makes cuts cheap finds the same as what is slow and plain.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "cutting/blade_sweep.h"
#include "mls/crossing.h"
#include "mls/cut.h"
#include "mls/faces.h"
#include "mls/near_nodes.h"
#include "mls_scenes.h"

namespace tissue_sim {
namespace {

constexpr MlsPlacement kPlacements[] = {MlsPlacement::kRegular, MlsPlacement::kGraded};

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
    EXPECT_LT(s.connectivity.other.size(), 2 * 0.25 * s.pairs.other.size());
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

/// By their definition: MlsNear of all outer nodes, by number.
std::vector<std::pair<int, int>> near_by_definition(const MlsState& s,
                                                    const std::vector<std::int32_t>& piece,
                                                    const std::vector<std::int32_t>& outer,
                                                    const std::vector<float>& skin) {
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t k = 0; k < outer.size(); ++k) {
    for (std::size_t l = k + 1; l < outer.size(); ++l) {
      const int i = outer[k], j = outer[l];
      const float edge = 0.5f * (s.edge[i] + s.edge[j]);
      const float reach =
          touches_by_faces(s)
              ? std::sqrt(mls_contact::reach2(s.face[4 * i + 3] + s.face[4 * j + 3], edge))
              : edge;
      if (!((s.position(i) - s.position(j)).norm() <= reach + skin[k] + skin[l])) continue;
      const bool far = (s.nodes.place[i] - s.nodes.place[j]).norm() > 2.5 * edge;
      const int e = s.pairs.find(i, j);
      const bool crossed = e >= 0 && s.pairs.crossed[e] != 0;
      if (piece[i] != piece[j] || far || crossed) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

TEST(MlsNearNodes, AreThoseThatALookAtEachFinds) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> even(-1, 1);
  for (const MlsPlacement placement : kPlacements) {
    for (const MlsContact contact : {MlsContact::kNodes, MlsContact::kFaces}) {
      Scene scene = mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement);
      scene.mls.contact = contact;
      MlsTissue tissue(scene);
      MlsState& s = tissue.state();
      // Across the whole body, and a cut that leaves a piece whole; folded and sheared.
      const Vec3 middle(0.006, 0.005, 0.004);
      tissue.cut_now(plane_cut(middle, Vec3(1, 0.2, 0.1)));
      tissue.cut_now(upright_blade({Vec3(0.003, -0.1, 0), Vec3(0.003, 0.006, 0)}));
      UnionFind linked = join_uncrossed(s);
      std::vector<std::int32_t> piece(s.count()), outer;
      std::vector<float> skin;
      for (int i = 0; i < s.count(); ++i) {
        piece[i] = linked.root(i);
        const Vec3 x = s.nodes.place[i];
        const Vec3 u(x.x() < 0.006 ? 0.0015 : 0.0, 40 * x.y() * x.y() * (x.x() - 0.006),
                     0.3 * x.y() + 1e-4 * even(random));
        for (int a = 0; a < 3; ++a) s.u[4 * i + a] = static_cast<float>(u[a]);
        if (s.outer[i] == 0) continue;
        outer.push_back(i);
        skin.push_back(static_cast<float>(0.0004 * (1 + even(random))));
      }
      s.u[4 * outer[3]] = 1e9f;
      s.u[4 * outer[7]] = NAN;
      std::vector<std::pair<int, int>> found;
      for (const MlsNear& pair : find_near_nodes(s, piece, outer, skin)) {
        ASSERT_LT(pair.low, pair.high);
        found.emplace_back(pair.low, pair.high);
      }
      std::sort(found.begin(), found.end());
      EXPECT_GT(found.size(), 500u);
      EXPECT_EQ(found, near_by_definition(s, piece, outer, skin));
    }
  }
}

}  // namespace
}  // namespace tissue_sim
