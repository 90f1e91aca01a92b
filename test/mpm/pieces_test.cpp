// Pieces after cuts against those that a walk over the bonds finds.
#include <gtest/gtest.h>

#include <algorithm>
#include <queue>
#include <random>
#include <set>

#include "mpm/cut_tissue.h"
#include "mpm/lattice/bonds.h"
#include "support/cut_scenes.h"

namespace tissue_sim {
namespace {

/// Breaks the bonds through the surface of a box of sites.
void cut_out(const LatticeBody& body, Points& points, const int (&low)[3], const int (&high)[3]) {
  const auto inside = [&](const Points::Site& s) {
    return s.x >= low[0] && s.y >= low[1] && s.z >= low[2] && s.x < high[0] && s.y < high[1] &&
           s.z < high[2];
  };
  for (std::int32_t p = 0; p < points.size(); ++p) {
    for (int k = kForwardBond; k < kBondCount; ++k) {
      if ((points.bonds[p] >> k & 1) == 0) continue;
      const Points::Site& s = points.site[p];
      const BondOffset o = bond_offset(k);
      const std::int32_t q = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      if (inside(s) == inside(points.site[q])) continue;
      points.bonds[p] &= static_cast<std::uint8_t>(~(1u << k));
      points.bonds[q] &= static_cast<std::uint8_t>(~(1u << opposite_bond(k)));
    }
  }
}

/// Lowest point of each point's component, by breadth-first search over the bonds.
std::vector<std::int32_t> walk_bonds(const LatticeBody& body, const Points& points) {
  std::vector<std::int32_t> lowest(points.size(), -1);
  for (std::int32_t start = 0; start < points.size(); ++start) {
    if (lowest[start] >= 0) continue;
    std::queue<std::int32_t> queue({start});
    lowest[start] = start;
    for (; !queue.empty(); queue.pop()) {
      const std::int32_t p = queue.front();
      for (int k = 0; k < kBondCount; ++k) {
        if ((points.bonds[p] >> k & 1) == 0) continue;
        const Points::Site& s = points.site[p];
        const BondOffset o = bond_offset(k);
        const std::int32_t q = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
        if (lowest[q] >= 0) continue;
        lowest[q] = start;
        queue.push(q);
      }
    }
  }
  return lowest;
}

/// Checks the pieces after a cut against what they were before, the components and what is said of
/// pieces: the largest part keeps the id, of equals the one with the lowest point.
void expect_right(const Points& points, const std::vector<std::int32_t>& component,
                  const Pieces& before, const Pieces& after, const std::vector<int>& fresh) {
  std::vector<std::int32_t> count(points.size(), 0);
  for (const std::int32_t c : component) ++count[c];
  std::vector<std::int32_t> heir(before.next_id, -1);  // the component that keeps the id
  for (std::int32_t p = 0; p < points.size(); ++p) {
    std::int32_t& h = heir[before.of_point[p]];
    if (component[p] == p && (h < 0 || count[p] > count[h])) h = p;
  }
  std::set<int> new_ids;
  bool held = false;
  for (std::int32_t p = 0; p < points.size(); ++p) {
    const int id = after.of_point[p], was = before.of_point[p];
    ASSERT_EQ(id, after.of_point[component[p]]);
    ASSERT_EQ(id == was, component[p] == heir[was]);
    if (id != was) new_ids.insert(id);
    held = held || points.anchored[p] != 0;
  }
  EXPECT_EQ(std::vector<int>(new_ids.begin(), new_ids.end()), fresh);
  EXPECT_EQ(after.next_id, before.next_id + static_cast<int>(fresh.size()));
  ASSERT_EQ(after.all.size(), before.all.size() + fresh.size());
  for (const Fragment& f : after.all) {
    int points_of = 0;
    double volume = 0;
    bool anchored = false;
    for (std::int32_t p = 0; p < points.size(); ++p) {
      if (after.of_point[p] != f.id) continue;
      ++points_of;
      volume += points.volume[p];
      anchored = anchored || points.anchored[p] != 0;
      if (f.id >= before.next_id) {
        ASSERT_EQ(f.parent, before.of_point[p]);
      }
    }
    EXPECT_EQ(f.point_count, points_of) << "piece " << f.id;
    EXPECT_NEAR(f.volume, volume, 1e-9 * volume) << "piece " << f.id;
    EXPECT_EQ(f.loose, !anchored && (f.parent >= 0 || held)) << "piece " << f.id;
  }
}

LatticeTissue whole_tissue(const Scene& scene) {
  LatticeTissue tissue;
  tissue.bodies = make_lattice_bodies(scene, tissue.points, nullptr);
  tissue.fields = std::make_unique<NodeFields>(tissue.bodies, tissue.points, tissue.nodes);
  return tissue;
}

TEST(Pieces, AreWhatAWalkOverTheBondsFinds) {
  for (const bool anchored : {false, true}) {
    Scene scene = free_box(Vec3(0.03, 0.024, 0.02), 0.002);
    if (anchored) {
      Region below;
      below.z = 0.005;
      scene.bodies[0].anchors = {below};
    }
    LatticeTissue tissue = whole_tissue(scene);
    Points& points = tissue.points;
    const LatticeBody& body = tissue.bodies[0];
    Pieces pieces = whole_pieces(tissue);
    expect_right(points, walk_bonds(body, points), pieces, pieces, {});
    std::mt19937 random(3);
    const auto upto = [&](int n) { return static_cast<int>(random() % n); };
    int debris = 0;
    for (int cut = 0; cut < 60; ++cut) {
      int low[3], high[3];
      const int size[3] = {2 * body.nx, 2 * body.ny, 2 * body.nz};
      for (int a = 0; a < 3; ++a) {
        low[a] = upto(size[a]);
        high[a] = low[a] + 1 + upto(4);
      }
      if (cut % 10 == 9) {  // all the way through
        const int across = upto(3);
        for (int a = 0; a < 3; ++a) {
          if (a != across) low[a] = 0, high[a] = size[a];
        }
      }
      cut_out(body, points, low, high);
      const Pieces before = pieces;
      const std::vector<int> fresh = update_pieces(tissue, pieces);
      debris += static_cast<int>(fresh.size());
      expect_right(points, walk_bonds(body, points), before, pieces, fresh);
      if (HasFatalFailure()) FAIL() << "cut " << cut;
    }
    EXPECT_GT(debris, 40);
    EXPECT_GT(std::count_if(pieces.all.begin(), pieces.all.end(),
                            [](const Fragment& f) { return f.point_count > 1000; }),
              1);
  }
}

/// Single bonds break at random until all has come to bits.
TEST(Pieces, ComeApartOnlyWhereTheyMay) {
  LatticeTissue tissue = whole_tissue(free_box(Vec3(0.02, 0.016, 0.012), 0.002));
  Points& points = tissue.points;
  Pieces pieces = whole_pieces(tissue);
  Cpu cpu(1);
  std::mt19937 random(5);
  int may = 0, parted = 0, rounds = 0;
  for (; pieces.all.size() < 500; ++rounds) {
    std::vector<std::int32_t> changed;
    for (int i = 0; i < 12; ++i) {
      const auto p = static_cast<std::int32_t>(random() % points.size());
      const int k = kForwardBond + static_cast<int>(random() % 3);
      if ((points.bonds[p] >> k & 1) == 0) continue;
      const std::int32_t q = tissue.bodies[0].next_point(points.site[p], k - kForwardBond);
      break_bond(k, points.bonds[p], points.bonds[q]);
      changed.push_back(p);
      changed.push_back(q);
    }
    tissue.fields->update(tissue.bodies, points, changed, tissue.nodes, cpu);
    const bool may_have = may_have_parted(tissue, changed);
    const bool have = !update_pieces(tissue, pieces).empty();
    EXPECT_TRUE(may_have || !have) << "round " << rounds;
    may += may_have;
    parted += have;
  }
  EXPECT_GT(parted, 50);
  EXPECT_GE(may, parted);
  EXPECT_GT(rounds, 2 * may) << "it is to spare work";
}

/// A bond that is in no square of four bonds is a bond bridge: the places at its ends, by walking
/// around each bond, while bonds break at random.
TEST(BondBridges, AreBondsInNoSquare) {
  Points points;
  const std::vector<LatticeBody> bodies =
      make_lattice_bodies(free_box(Vec3(0.012, 0.01, 0.008), 0.002), points, nullptr);
  const LatticeBody& body = bodies[0];
  BondWindows bonds(bodies, points);
  const auto next = [&](std::int32_t p, int k) {  // over bond k, -1 where there is none
    const BondOffset o = bond_offset(k);
    const Points::Site& s = points.site[p];
    return p >= 0 && (points.bonds[p] >> k & 1) != 0 ? body.point(s.x + o.x, s.y + o.y, s.z + o.z)
                                                     : -1;
  };
  const auto ends_bridge = [&](std::int32_t p) {
    for (int k = 0; k < kBondCount; ++k) {
      if (p < 0 || next(p, k) < 0) continue;
      bool in_square = false;
      for (int side = 0; side < kBondCount; ++side) {
        if (side == k || side == opposite_bond(k) || next(p, side) < 0) continue;
        const std::int32_t corner = next(next(p, side), k);
        in_square = in_square || (corner >= 0 && next(next(p, k), side) == corner);
      }
      if (!in_square) return true;
    }
    return false;
  };
  std::mt19937 random(11);
  int found = 0;
  for (int round = 0; round < 30; ++round) {
    std::vector<std::int32_t> changed;
    for (int i = 0; i < 40; ++i) {
      const auto p = static_cast<std::int32_t>(random() % points.size());
      const int axis = static_cast<int>(random() % 3), k = kForwardBond + axis;
      if ((points.bonds[p] >> k & 1) == 0) continue;
      const std::int32_t q = body.next_point(points.site[p], axis);
      break_bond(k, points.bonds[p], points.bonds[q]);
      changed.push_back(p);
      changed.push_back(q);
    }
    bonds.update(points, changed);
    for (int z = 0; z < body.nz; ++z) {
      for (int y = 0; y < body.ny; ++y) {
        for (int x = 0; x < body.nx; ++x) {
          const Planes ends = bonds.bridge_ends(0, x, y, z);
          for (int i = 0; i < 64; ++i) {  // the places around the node
            const int at[3] = {1 + i % 4, 1 + i / 4 % 4, 1 + i / 16};
            const std::int32_t p =
                body.point(2 * x - 2 + at[0], 2 * y - 2 + at[1], 2 * z - 2 + at[2]);
            const bool is_end = (ends[at[2]] >> bit_in_plane(at[0], at[1]) & 1) != 0;
            ASSERT_EQ(is_end, ends_bridge(p)) << "round " << round << ", point " << p;
            found += is_end;
          }
        }
      }
    }
  }
  EXPECT_GT(found, 1000);
}

}  // namespace
}  // namespace tissue_sim
