// What a cut does, and what it does not.
#include <gtest/gtest.h>

#include <numeric>

#include "cutting/blade_sweep.h"
#include "mpm/lattice/bonds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/rigid_modes.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.03, 0.02);
const Vec3 kMiddle = 0.5 * kSize;

/// Volumes of the pieces [mL], largest first.
std::vector<double> volumes(Tissue& tissue) {
  std::vector<double> result;
  for (const Fragment& f : tissue.fragments()) result.push_back(f.volume * 1e6);
  std::sort(result.rbegin(), result.rend());
  return result;
}

/// The points on the positive side of the sign function, counted by place: what a full cut must
/// part.
template <class Side>
int points_where(const MpmState& s, const Side& side) {
  int count = 0;
  for (int p = 0; p < s.points.size(); ++p) {
    const Points::Site& site = s.points.site[p];
    count += side(s.bodies[site.body].site_position(site.x, site.y, site.z)) ? 1 : 0;
  }
  return count;
}

TEST(Cut, StraightThroughMakesTwoPiecesOfTheSidesVolumes) {
  MpmTissue tissue(free_box(kSize, 0.002));
  const CutReport report = cut_now(tissue, plane_cut(Vec3(0.013, 0, 0), Vec3::UnitX()));
  EXPECT_EQ(report.new_fragments, std::vector<int>{1});
  EXPECT_EQ(report.bonds_broken, 30 * 20);
  EXPECT_EQ(report.points_separated, 2 * 30 * 20);
  const std::vector<double> v = volumes(tissue);
  ASSERT_EQ(v.size(), 2u);
  EXPECT_NEAR(v[0], (0.04 - 0.013) * 600, 1e-3);
  EXPECT_NEAR(v[1], 0.013 * 600, 1e-3);
}

TEST(Cut, AnyPlanePartsExactlyThePointsOnItsSides) {
  const Vec3 normals[] = {{1, 0, 0},  {0, 1, 0},      {0, 0, 1},     {1, 1, 0},
                          {1, -1, 1}, {0.3, 1, -0.2}, {-0.7, 0.1, 1}};
  for (const Vec3& normal : normals) {
    MpmTissue tissue(free_box(kSize, 0.002));
    const Vec3 place = kMiddle + Vec3(1e-4, 2e-4, 3e-4);
    cut_now(tissue, plane_cut(place, normal));
    const int side =
        points_where(tissue.state(), [&](const Vec3& x) { return (x - place).dot(normal) > 0; });
    const int other = tissue.point_count() - side;
    EXPECT_EQ(piece_sizes(tissue), (std::vector<int>{std::max(side, other), std::min(side, other)}))
        << "normal " << normal.transpose();
  }
}

TEST(Cut, ThroughTheLatticePlanesThemselvesStillMakesTwoPieces) {
  MpmTissue tissue(free_box(kSize, 0.002));
  cut_now(tissue, plane_cut(Vec3(0.0205, 0, 0), Vec3::UnitX()));  // through a layer of points
  EXPECT_EQ(tissue.fragments().size(), 2u);
}

TEST(Cut, AlongACurvePartsExactlyThePointsOnItsSides) {
  MpmTissue tissue(free_box(kSize, 0.002));
  const auto curve = [](double y) { return 0.02 + 0.006 * std::sin(120 * y); };
  std::vector<Vec3> places;
  for (double y = -0.005; y < 0.0351; y += 0.0005) places.push_back({curve(y), y, 0});
  cut_now(tissue, upright_blade(places));
  const std::vector<int> sizes = piece_sizes(tissue);
  ASSERT_EQ(sizes.size(), 2u);
  const int right = points_where(tissue.state(), [&](const Vec3& x) { return x[0] > curve(x[1]); });
  // The blade's path is a polyline: it may pass a point on the other side than the curve.
  EXPECT_NEAR(std::min(sizes[0], sizes[1]), std::min(right, tissue.point_count() - right), 20);
}

TEST(Cut, InPartLeavesOnePiece) {
  MpmTissue tissue(free_box(kSize, 0.002));
  const CutReport report =
      cut_now(tissue, upright_blade({Vec3(0.02, -0.01, 0), Vec3(0.02, 0.02, 0)}));
  EXPECT_EQ(report.bonds_broken, 20 * 20);
  EXPECT_TRUE(report.new_fragments.empty());
  EXPECT_EQ(tissue.fragments().size(), 1u);
}

TEST(Cut, TwoStrokesOnOneLineFinishWhatOneBegan) {
  MpmTissue tissue(free_box(kSize, 0.002));
  cut_now(tissue, upright_blade({Vec3(0.02, -0.01, 0), Vec3(0.02, 0.0171, 0)}));
  EXPECT_EQ(tissue.fragments().size(), 1u);
  cut_now(tissue, upright_blade({Vec3(0.02, 0.04, 0), Vec3(0.02, 0.0169, 0)}));
  EXPECT_EQ(tissue.fragments().size(), 2u);
}

TEST(Cut, TwoThatCrossMakeFourAndThreePlanesEight) {
  MpmTissue tissue(free_box(kSize, 0.002));
  cut_now(tissue, plane_cut(kMiddle, Vec3(1, 0.2, 0)));
  cut_now(tissue, plane_cut(kMiddle, Vec3(-0.2, 1, 0.1)));
  EXPECT_EQ(tissue.fragments().size(), 4u);
  cut_now(tissue, plane_cut(kMiddle, Vec3(0, 0.1, 1)));
  EXPECT_EQ(tissue.fragments().size(), 8u);
  const std::vector<double> v = volumes(tissue);
  EXPECT_NEAR(std::accumulate(v.begin(), v.end(), 0.0), 24, 1e-3);
}

TEST(Cut, TShapedAndLShapedCutsPartWhatTheyEnclose) {
  MpmTissue t(free_box(kSize, 0.002));
  cut_now(t, plane_cut(kMiddle, Vec3::UnitX()));
  cut_now(t, upright_blade({Vec3(0.02, 0.015, 0), Vec3(0.06, 0.015, 0)}));
  EXPECT_EQ(t.fragments().size(), 3u);
  MpmTissue l(free_box(kSize, 0.002));
  cut_now(l,
          upright_blade({Vec3(-0.01, 0.0151, 0), Vec3(0.0201, 0.0151, 0), Vec3(0.0201, 0.04, 0)}));
  const std::vector<double> v = volumes(l);
  ASSERT_EQ(v.size(), 2u);
  EXPECT_NEAR(v[1], 0.02 * 0.015 * 0.02 * 1e6, 0.3);
}

TEST(Cut, SlowBreaksTheSameBondsAsFast) {
  const auto cut_in = [](int strokes) {
    auto tissue = std::make_unique<MpmTissue>(free_box(kSize, 0.002));
    const auto at = [](double s) { return Vec3(0.012 + 0.016 * s, -0.01 + 0.05 * s, 0); };
    for (int i = 0; i < strokes; ++i) {
      cut_now(*tissue, upright_blade({at(double(i) / strokes), at((i + 1.0) / strokes)}));
    }
    return tissue;
  };
  const auto fast = cut_in(1), slow = cut_in(397);
  EXPECT_EQ(fast->fragments().size(), 2u);
  EXPECT_EQ(fast->state().points.bonds, slow->state().points.bonds);
  EXPECT_EQ(fast->state().nodes.size(), slow->state().nodes.size());
  EXPECT_EQ(fast->state().fields->split_count(), slow->state().fields->split_count());
}

TEST(Cut, AddsNoEnergyAndMovesNothing) {
  MpmTissue tissue(free_box(kSize, 0.002));
  deform(tissue.state());
  shake(tissue.state(), 3, 5e-5);
  advance_by(tissue, 0, 1e-4f, {});
  const FrameResult before = tissue.finish();
  std::vector<std::uint8_t> cloud_before, cloud_after;
  tissue.read_points({}, cloud_before);
  ASSERT_GT(cut_now(tissue, plane_cut(Vec3(0.024, 0.02, 0.01), Vec3(1, 0.3, 0.2))).bonds_broken, 0);
  advance_by(tissue, 0, 1e-4f, {});
  const FrameResult after = tissue.finish();
  EXPECT_NEAR(after.kinetic_energy, before.kinetic_energy, 1e-6 * before.kinetic_energy);
  // Cells that are no longer full are stabilised: a few millionths.
  EXPECT_NEAR(after.elastic_energy, before.elastic_energy, 1e-5 * before.elastic_energy);
  tissue.read_points({}, cloud_after);
  for (std::size_t i = 0; i < cloud_before.size(); i += sizeof(Point)) {
    const auto* a = reinterpret_cast<const Point*>(&cloud_before[i]);
    const auto* b = reinterpret_cast<const Point*>(&cloud_after[i]);
    ASSERT_NEAR(a->x, b->x, 3e-8);
    ASSERT_NEAR(a->z, b->z, 3e-8);
  }
}

TEST(Cut, NoForcePassesBetweenThePieces) {
  // Whatever one piece does, the other takes the same step, bit for bit.
  const auto step = [](double pull) {
    auto tissue = std::make_unique<MpmTissue>(free_box(kSize, 0.002));
    MpmState& s = tissue->state();
    cut_now(*tissue, plane_cut(kMiddle, Vec3(1, 0.5, 0.3)));
    shake(s, 5, 5e-5);
    for (int p = 0; p < s.points.size(); ++p) {
      if (tissue->fragment_of(p) == 0) continue;
      const Points::Site& site = s.points.site[p];
      for (int k = 0; k < 27; ++k) {
        const int n = s.fields->node(s.bodies[0], site, k);
        s.nodes.u[1][n] = static_cast<float>(pull * n);
      }
    }
    std::vector<ColliderLoad> loads(s.colliders.size());
    for (int i = 0; i < 5; ++i) substep(s, 1e-5f, loads);
    return tissue;
  };
  const auto a = step(0), b = step(1e-7);
  int compared = 0, differ = 0;
  for (int p = 0; p < a->point_count(); ++p) {
    const Points::Site& site = a->state().points.site[p];
    for (int k = 0; k < 27; ++k) {
      const int n = a->state().fields->node(a->state().bodies[0], site, k);
      const bool same = a->state().nodes.v[1][n] == b->state().nodes.v[1][n];
      if (a->fragment_of(p) == 0) {
        ASSERT_TRUE(same) << "point " << p << ", node " << n;
        ++compared;
      } else {
        differ += !same;
      }
    }
  }
  EXPECT_GT(compared, 1000);
  EXPECT_GT(differ, 1000) << "the pull must do something";
}

TEST(Cut, EachPieceHasSixRigidModesAndNoOtherMotionIsFree) {
  const Vec3 size(0.008, 0.006, 0.006), middle(0.0039, 0.0031, 0.0028);
  const auto modes = [&](const std::vector<BladePath>& cuts) {
    MpmTissue tissue(free_box(size, 0.002));
    for (const BladePath& path : cuts) cut_now(tissue, path);
    EXPECT_GE(piece_sizes(tissue).back(), 4);
    return std::make_pair(rigid_modes(tissue.state()),
                          6 * static_cast<int>(tissue.fragments().size()));
  };
  const BladePath in_part = upright_blade({Vec3(0.0039, -0.01, 0), Vec3(0.0039, 0.0031, 0)});
  const std::vector<std::vector<BladePath>> all = {
      {},
      {plane_cut(middle, Vec3::UnitX())},
      {plane_cut(middle, Vec3(1, 0.4, 0.2))},
      {in_part},
      {plane_cut(middle, Vec3::UnitX()), plane_cut(middle, Vec3::UnitY())},
      {plane_cut(middle, Vec3::UnitX()), upright_blade({middle, Vec3(0.02, 0.0031, 0)})},
      {in_part, upright_blade({Vec3(0.0039, 0.02, 0), Vec3(0.0039, 0.0031, 0)})},
      {in_part, plane_cut(middle, Vec3::UnitZ())},
      {plane_cut(middle, Vec3(0.3, -0.5, 1)), plane_cut(middle, Vec3(1, 0.5, -0.7))},
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto [found, expected] = modes(all[i]);
    EXPECT_EQ(found, expected) << "case " << i;
  }
}

TEST(BladeSweep, MeetsABondThatMovesThroughAnEdgeAtRest) {
  const Vec3 a(0, 0, -1), b(0, 0, 1);
  const auto bond = [](double y0, double y1) {
    return MovingSegment{Vec3(-1, y0, 0), Vec3(1, y0, 0), Vec3(-1, y1, 0), Vec3(1, y1, 0)};
  };
  EXPECT_TRUE(edge_passes({a, b, a, b}, bond(-0.5, 0.5)));
  EXPECT_FALSE(edge_passes({a, b, a, b}, bond(0.1, 0.5)));
  // Both move, the edge runs after the bond and does not catch up.
  const Vec3 ahead(0, 0.3, 0);
  EXPECT_FALSE(edge_passes({a, b, a + ahead, b + ahead}, bond(0.1, 0.5)));
  EXPECT_TRUE(edge_passes({a, b, a + 2 * ahead, b + 2 * ahead}, bond(0.1, 0.5)));
}

TEST(BladeSweep, OfAnEdgeThatIsHeldStaysWhereItIs) {
  const Vec3 a(0.01, 0.02, 0), b(0.01, 0.02, 0.03);
  const SweptEdge held = swept({a, b, a, b});
  const Vec3 bond(0, 0, 0.001);
  for (const Vec3& aside : {Vec3(0.002, 0, 0), Vec3(0, 0.002, 0), Vec3(-0.002, -0.002, 0)}) {
    const Vec3 p = 0.5 * (a + b) + aside;
    EXPECT_TRUE(stays_aside(held, {p, p + bond, p, p + bond})) << aside.transpose();
  }
  const Vec3 p = 0.5 * (a + b);
  EXPECT_FALSE(stays_aside(held, {p, p + bond, p, p + bond}));
}

TEST(BladeSweep, AgreesWithFineSampling) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto v = [&] { return Vec3(u(random), u(random), u(random)); };
  int hits = 0;
  for (int i = 0; i < 2000; ++i) {
    const MovingSegment e{v(), v(), v(), v()}, b{v(), v(), v(), v()};
    // Signed volume of the four ends, sampled: where it changes sign, do the segments cross?
    bool expected = false;
    double previous = 0;
    for (int k = 0; k <= 4000 && !expected; ++k) {
      const double s = k / 4000.0;
      const Vec3 A = e.a0 + s * (e.a1 - e.a0), B = e.b0 + s * (e.b1 - e.b0);
      const Vec3 P = b.a0 + s * (b.a1 - b.a0), Q = b.b0 + s * (b.b1 - b.b0);
      const double now = (B - A).dot((P - A).cross(Q - A));
      if (k > 0 && now * previous < 0) {
        const Vec3 n = (B - A).cross(Q - P);
        const double t = (P - A).cross(B - A).dot(n) / n.squaredNorm();
        const double w = (P - A).cross(Q - P).dot(n) / n.squaredNorm();
        if (std::min({t, 1 - t, w, 1 - w}) > -1e-3 && std::min({t, 1 - t, w, 1 - w}) < 1e-3) break;
        expected = t > 0 && t < 1 && w > 0 && w < 1;
      }
      previous = now;
    }
    hits += expected;
    EXPECT_TRUE(!expected || edge_passes(e, b)) << i;
  }
  EXPECT_GT(hits, 50);
}

}  // namespace
}  // namespace tissue_sim
