// Facets of cut faces against the surface that the blade swept.
#include <gtest/gtest.h>

#include <cmath>

#include "contact/face_places.h"
#include "contact/facet_motion.h"
#include "cut_scenes.h"

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
      const int x = block->x + facet.cell % block->plane % block->pitch,
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
  EXPECT_LT(m.off, 1e-5);
  EXPECT_LT(m.angle, 1e-5);
}

TEST(Facets, LieInTheirOwnPlaneWhereCutsCross) {
  MpmTissue tissue(free_box(kSize, kCell));
  const Vec3 place = 0.5 * kSize + Vec3::Constant(3e-4);
  const std::vector<Vec3> normals{{1, 0.2, 0}, {-0.2, 1, 0.1}, {0, 0.1, 1}};
  for (const Vec3& n : normals) cut_now(tissue, plane_cut(place, n));
  const Misfit m = misfit(tissue.state(), normals, place);
  EXPECT_GT(m.count, 100);
  EXPECT_LT(m.off, 1e-5);
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
  EXPECT_LT(m.off, 2e-3);
  EXPECT_LT(m.angle, 2e-3);
}

}  // namespace
}  // namespace tissue_sim
