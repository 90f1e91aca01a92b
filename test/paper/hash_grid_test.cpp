// Fragments by hash grid, by breadth-first search and by links are the same.
#include "paper/hash_grid.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <set>
#include <string>

#include "paper/breadth_first.h"
#include "paper/torn_points.h"
#include "support/cut_scenes.h"

namespace tissue_sim {
namespace {

/// Point by point and cell by cell, by the definition alone.
PointGroups brute_force(const PointPlaces& places, double h) {
  const int dimensions = places.x[2] != nullptr ? 3 : 2;
  using Cell = std::array<long, 3>;
  const auto cell_of = [&](int p) {
    Cell c{};
    for (int a = 0; a < dimensions; ++a) {
      c[a] = static_cast<long>(std::floor(places.x[a][p] / h));
    }
    return c;
  };
  std::map<Cell, int> group;  // -1 before it is known
  for (int p = 0; p < places.count; ++p) group[cell_of(p)] = -1;
  PointGroups groups;
  for (int p = 0; p < places.count; ++p) {
    const Cell own = cell_of(p);
    if (group[own] < 0) {
      std::vector<Cell> stack = {own};
      group[own] = static_cast<int>(groups.count.size());
      groups.count.push_back(0);
      while (!stack.empty()) {
        const Cell c = stack.back();
        stack.pop_back();
        for (int k = 0; k < 2 * dimensions; ++k) {
          Cell next = c;
          next[k / 2] += k % 2 == 0 ? -1 : 1;
          const auto found = group.find(next);
          if (found == group.end() || found->second >= 0) continue;
          found->second = group[own];
          stack.push_back(next);
        }
      }
    }
    groups.of_point.push_back(group[own]);
    ++groups.count[group[own]];
  }
  return groups;
}

void expect_same(const PointGroups& a, const PointGroups& b, const std::string& what) {
  EXPECT_EQ(a.of_point, b.of_point) << what;
  EXPECT_EQ(a.count, b.count) << what;
}

/// Hash grids of 1 to 3 threads, kept for all, against an expected partition.
class Grids {
 public:
  void expect(const PointGroups& expected, const PointPlaces& places, const CellBox& box) {
    for (int threads = 1; threads <= 3; ++threads) {
      Cpu cpu(threads);
      expect_same(grid_[threads - 1].find_groups(places, box, cpu), expected,
                  "hash grid, threads: " + std::to_string(threads));
    }
  }

 private:
  HashGrid grid_[3];
};

TEST(HashGrid, FindsWhatBruteForceFinds) {
  std::mt19937 random(1);
  Grids grids;
  BreadthFirstSearch search;
  Cpu cpu(1);
  for (const int dimensions : {2, 3}) {
    for (const int count : {1, 2, 40, 700, 20000}) {
      for (const double fill : {0.3, 0.55, 1.5}) {  // points a cell
        SCOPED_TRACE(std::to_string(dimensions) + " " + std::to_string(count) + " " +
                     std::to_string(fill));
        const double h = 0.37, extent = h * std::pow(count / fill, 1.0 / dimensions);
        std::uniform_real_distribution<float> u(static_cast<float>(-0.6 * extent),
                                                static_cast<float>(0.4 * extent));
        std::vector<float> x[3];
        PointPlaces places;
        for (int a = 0; a < dimensions; ++a) {
          for (int p = 0; p < count; ++p) x[a].push_back(u(random));
          places.x[a] = x[a].data();
        }
        places.count = count;
        const CellBox box = cell_box(places, h);
        const PointGroups expected = brute_force(places, h);
        grids.expect(expected, places, box);
        expect_same(search.find_groups(places, box, cpu), expected, "breadth-first search");
      }
    }
  }
}

TEST(HashGrid, FindsPointsThatFlewFarApart) {  // in a real hash table
  std::mt19937 random(2);
  std::uniform_int_distribution<int> offset(-400000, 400000), step(0, 5);
  std::vector<float> x[3];
  for (int clump = 0; clump < 300; ++clump) {
    float at[3];
    for (float& a : at) a = 0.5f + static_cast<float>(offset(random));
    for (int p = 0; p < 200; ++p) {
      const int k = step(random);
      at[k / 2] += k % 2 == 0 ? -1 : 1;
      for (int a = 0; a < 3; ++a) x[a].push_back(at[a]);
    }
  }
  PointPlaces places;
  for (int a = 0; a < 3; ++a) places.x[a] = x[a].data();
  places.count = static_cast<std::int32_t>(x[0].size());
  const CellBox box = cell_box(places, 1);
  const PointGroups expected = brute_force(places, 1);
  EXPECT_GE(expected.count.size(), 299u);
  Grids().expect(expected, places, box);
  Cpu cpu(1);
  EXPECT_THROW(BreadthFirstSearch().find_groups(places, box, cpu), std::invalid_argument);
}

TEST(HashGrid, FollowsAMaze) {  // each wall joins late what was labelled apart before
  std::vector<float> x, y;
  constexpr int kSize = 201;
  for (int j = 0; j < kSize; ++j) {
    for (int i = 0; i < kSize; ++i) {
      const int ring = std::min({i, j, kSize - 1 - i, kSize - 1 - j});
      const bool door =
          ring % 2 == 1 && j == kSize / 2 && (ring % 4 == 1 ? i : kSize - 1 - i) == ring;
      if (ring % 2 == 1 && !door) continue;
      x.push_back(0.5f + static_cast<float>(i));
      y.push_back(0.5f + static_cast<float>(j));
    }
  }
  PointPlaces places;
  places.x[0] = x.data(), places.x[1] = y.data();
  places.count = static_cast<std::int32_t>(x.size());
  const PointGroups expected = brute_force(places, 1);
  EXPECT_EQ(expected.count.size(), 1u);
  Grids().expect(expected, places, cell_box(places, 1));
}

TEST(HashGrid, AgreesWithLinksWhereBlocksFlewApart) {
  BreadthFirstSearch search;
  Cpu cpu(1);
  for (const int dimensions : {2, 3}) {
    for (const int points : {25000, 1000000}) {
      const TornPoints torn = torn_points(dimensions, points, 10, 2);
      UnionFind linked(torn.x[0].size());
      for (const auto& link : torn.links) linked.join(link[0], link[1]);
      const PointGroups expected = groups_of_links(linked);
      EXPECT_GE(expected.count.size(), 27u);
      Grids().expect(expected, torn.places(), torn.box);
      expect_same(search.find_groups(torn.places(), torn.box, cpu), expected, "search");
    }
  }
}

TEST(HashGrid, AgreesWithTheBondsOfCutTissue) {
  const Vec3 size(0.024, 0.02, 0.016);
  const double h = 0.002;
  MpmTissue tissue(free_box(size, h));
  const Vec3 place = Vec3(0.487, 0.513, 0.461).cwiseProduct(size);
  const Vec3 normals[] = {{1, 0.2, 0}, {-0.2, 1, 0.1}, {0.3, 0.1, 1}};
  for (const Vec3& n : normals) cut_now(tissue, plane_cut(place, n));
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  const auto* points = reinterpret_cast<const Point*>(cloud.data());
  std::map<int, int> number;  // of pieces by their lowest point
  std::vector<std::int32_t> by_bonds;
  std::vector<float> x[3];
  for (int p = 0; p < count; ++p) {
    const int piece = number.try_emplace(points[p].fragment, int(number.size())).first->second;
    by_bonds.push_back(piece);
    x[0].push_back(points[p].x);
    x[1].push_back(points[p].y);
    x[2].push_back(points[p].z + static_cast<float>(piece * (size.z() + 5 * h)));
  }
  ASSERT_GE(number.size(), 8u);
  PointPlaces places;
  for (int a = 0; a < 3; ++a) places.x[a] = x[a].data();
  places.count = count;
  Cpu cpu(2);
  EXPECT_EQ(HashGrid().find_groups(places, cell_box(places, h), cpu).of_point, by_bonds);
}

TEST(HashGrid, FragmentsAreNeitherTooSmallNorTooLarge) {
  PointGroups groups;
  groups.count = {100, 3, 4, 20, 21, 1};
  EXPECT_EQ(fragments_among(groups, 4, 21), (std::vector<std::int32_t>{2, 3}));
}

TEST(HashGrid, RefusesWhatHasNoCell) {
  std::vector<float> x = {0, 1, 2}, y = {0, 0, 0};
  PointPlaces places;
  places.x[0] = x.data(), places.x[1] = y.data();
  places.count = 3;
  const CellBox box = cell_box(places, 1);
  HashGrid grid;
  Cpu cpu(1);
  for (const float bad : {100.0f, -100.0f, std::nanf(""), INFINITY, -INFINITY, 1e30f}) {
    x[1] = bad;
    EXPECT_THROW(grid.find_groups(places, box, cpu), std::invalid_argument) << bad;
    if (std::fabs(bad) == 100) continue;  // a larger box holds it
    EXPECT_THROW(cell_box(places, 1), std::invalid_argument) << bad;
  }
  x[1] = 1;
  EXPECT_EQ(grid.find_groups(places, box, cpu).count, std::vector<std::int32_t>{3});
  EXPECT_THROW(cell_box(places, 0), std::invalid_argument);
  places.count = 0;
  EXPECT_THROW(cell_box(places, 1), std::invalid_argument);
}

}  // namespace
}  // namespace tissue_sim
