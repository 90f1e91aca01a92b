// Facets of cut faces against the surface that the blade swept.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <tuple>

#include "mpm/blocks/known_facets.h"
#include "mpm/contact/face_places.h"
#include "mpm/surface/facet_motion.h"
#include "support/cut_scenes.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.03, 0.024, 0.02);
constexpr double kCell = 0.002;

struct Misfit {
  double off = 0;    ///< of a facet's centre from the plane it belongs to [cells]
  double angle = 0;  ///< between their normals [rad]
  int count = 0;
};

/// The largest misfit of the facets that no outer surface is part of.
Misfit misfit(const MpmState& s, const std::vector<Vec3>& normals, const Vec3& place) {
  Misfit most;
  for (const Block* block : s.blocks.all) {
    const LatticeBody& body = s.bodies[block->body];
    for (const Facet& facet : block->facets) {
      const int x = block->cell_x(facet.cell % block->plane % block->pitch),
                y = block->y + facet.cell % block->plane / block->pitch,
                z = block->z + facet.cell / block->plane;
      if (x == 0 || y == 0 || z == 0 || x + 1 == body.nx || y + 1 == body.ny || z + 1 == body.nz) {
        continue;
      }
      const FacetMotion m = facet_motion(body, *block, facet, s.nodes);
      double off = 1e9, angle = 1e9;
      for (const Vec3& n : normals) {
        const Vec3 unit = n.normalized();
        const double d = std::fabs((Vec3(m.x[0], m.x[1], m.x[2]) - place).dot(unit)) / kCell;
        const double sine = Vec3(m.normal[0], m.normal[1], m.normal[2]).cross(unit).norm();
        if (d + std::asin(std::min(1.0, sine)) > off + angle) continue;
        off = d;
        angle = std::asin(std::min(1.0, sine));
      }
      most.off = std::max(most.off, off);
      most.angle = std::max(most.angle, angle);
      ++most.count;
    }
  }
  return most;
}

TEST(Facets, LieInThePlaneOfAnObliqueCut) {
  MpmTissue tissue(free_box(kSize, kCell));
  const Vec3 place = 0.5 * kSize + Vec3::Constant(3e-4), normal(1, 0.6, 0.3);
  cut_now(tissue, plane_cut(place, normal));
  const Misfit m = misfit(tissue.state(), {normal}, place);
  EXPECT_GT(m.count, 100);
  EXPECT_TRUE(is_at_most("cut faces off the plane of the blade", m.off, 1e-5, "cells"));
  EXPECT_LT(m.angle, 1e-5);
}

TEST(Facets, LieInTheirOwnPlaneWhereCutsCross) {
  MpmTissue tissue(free_box(kSize, kCell));
  const Vec3 place = 0.5 * kSize + Vec3::Constant(3e-4);
  const std::vector<Vec3> normals{{1, 0.2, 0}, {-0.2, 1, 0.1}, {0, 0.1, 1}};
  for (const Vec3& n : normals) cut_now(tissue, plane_cut(place, n));
  const Misfit m = misfit(tissue.state(), normals, place);
  EXPECT_GT(m.count, 100);
  EXPECT_TRUE(is_at_most("the same where cuts cross", m.off, 1e-5, "cells"));
  EXPECT_LT(m.angle, 1e-5);
}

/// A plane through tissue that is stretched and sheared by a fifth, and bent: what the blade sweeps
/// is plane in the world.
TEST(Facets, LieInThePlaneOfACutThroughDeformedTissue) {
  MpmTissue tissue(free_box(kSize, kCell));
  deform(tissue.state());
  const Vec3 place = Vec3(0.5 * kSize.x() + 0.002, 0.5 * kSize.y(), 0.5 * kSize.z()),
             normal(1, 0.4, -0.2);
  cut_now(tissue, plane_cut(place, normal));
  const Misfit m = misfit(tissue.state(), {normal}, place);
  EXPECT_GT(m.count, 100);
  EXPECT_TRUE(is_at_most("the same, tissue that is bent and sheared", m.off, 2e-3, "cells"));
  EXPECT_LT(m.angle, 2e-3);
}

/// Cut after cut through an ellipsoid, whose rim has cells of all shapes: what is kept of the
/// facets from one cut to the next is what would be made anew, where regions are halved, too.
TEST(Facets, AreKeptOnlyWhereTheyWouldBeTheSame) {
  for (const auto& [with_inclusions, room] :
       {std::pair(false, 0), std::pair(true, 0), std::pair(false, 1000), std::pair(true, 1000)}) {
    Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
    if (with_inclusions) add_inclusions(scene, true);
    MpmTissue tissue(scene);
    tissue.state().blocks.room = room;
    const MpmState& s = tissue.state();
    const Vec3 middle = scene.bodies[0].pose.position;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> within(-1, 1);
    std::size_t count = 0;
    for (int i = 0; i < 8; ++i) {
      const Vec3 normal(within(random), within(random), within(random));
      const Vec3 off(within(random), within(random), within(random));
      cut_now(tissue, plane_cut(middle + 0.004 * off, normal));
      for (const Block* block : s.blocks.all) {
        const std::vector<Facet> anew =
            facets_of(s.bodies[0], s.points, s.nodes, *block, KnownFacets());
        ASSERT_EQ(block->facets.size(), anew.size()) << "cut " << i;
        count += anew.size();
        for (std::size_t k = 0; k < anew.size(); ++k) {
          const Facet &a = block->facets[k], &b = anew[k];
          EXPECT_EQ(std::tie(a.point, a.cell, a.direction, a.area),
                    std::tie(b.point, b.cell, b.direction, b.area));
          for (int c = 0; c < 3; ++c) {
            EXPECT_EQ(std::tie(a.center[c], a.normal[c], a.extent[c]),
                      std::tie(b.center[c], b.normal[c], b.extent[c]));
          }
        }
      }
    }
    EXPECT_GT(count, 1000u);
    EXPECT_EQ(s.blocks.has_halves(), room > 0);
  }
}

}  // namespace
}  // namespace tissue_sim
