// Pieces after cuts that are known against those that are found anew.
#include "fragments/pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "cut_scenes.h"
#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// Breaks the bonds through the surface of a box of sites; appends the points that lost any.
void cut_out(const LatticeBody& body, Points& points, const int (&low)[3], const int (&high)[3],
             std::vector<std::int32_t>& changed) {
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
      changed.push_back(p);
      changed.push_back(q);
    }
  }
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
}

TEST(Pieces, FoundAroundACutAreThoseFoundAnew) {
  for (const bool anchored : {false, true}) {
    Scene scene = free_box(Vec3(0.03, 0.024, 0.02), 0.002);
    if (anchored) {
      Region below;
      below.z = 0.005;
      scene.bodies[0].anchors = {below};
    }
    Points points;
    const std::vector<LatticeBody> bodies = make_lattice_bodies(scene, points, nullptr);
    const LatticeBody& body = bodies[0];
    Pieces pieces = whole_pieces(bodies, points);
    std::mt19937 random(3);
    const auto upto = [&](int n) { return static_cast<int>(random() % n); };
    int crumbs = 0, halves = 0;
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
      std::vector<std::int32_t> changed;
      cut_out(body, points, low, high, changed);
      Pieces anew = pieces;
      const std::vector<int> expected = update_pieces(bodies, points, anew);
      EXPECT_EQ(update_pieces(bodies, points, changed, pieces), expected) << "cut " << cut;
      crumbs += static_cast<int>(expected.size());
      ASSERT_EQ(pieces.of_point, anew.of_point) << "cut " << cut;
      ASSERT_EQ(pieces.all.size(), anew.all.size());
      EXPECT_EQ(pieces.next_id, anew.next_id);
      for (std::size_t i = 0; i < anew.all.size(); ++i) {
        const Fragment &a = pieces.all[i], &b = anew.all[i];
        EXPECT_EQ(a.id, b.id);
        EXPECT_EQ(a.parent, b.parent);
        EXPECT_EQ(a.loose, b.loose) << "piece " << a.id;
        EXPECT_EQ(a.point_count, b.point_count) << "piece " << a.id;
        EXPECT_NEAR(a.volume, b.volume, 1e-9 * b.volume);
        halves += cut == 59 && b.point_count > 1000 ? 1 : 0;
      }
    }
    EXPECT_GT(crumbs, 40);
    EXPECT_GT(halves, 1);
  }
}

}  // namespace
}  // namespace tissue_sim
