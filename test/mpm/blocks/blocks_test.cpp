// Blocks of a body that is cut: which points and nodes are where in them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"

namespace tissue_sim {
namespace {

const Vec3 kMiddle(0.0155, 0.0145, 0.0085);

/// The held box, deformed and cut by planes through its middle.
MpmTissue cut_box(const std::vector<Vec3>& normals) {
  MpmTissue tissue(free_body(Law::kFixedCorotated, 0, Shape::kBox));
  deform(tissue.state());
  for (const Vec3& normal : normals) cut_now(tissue, plane_cut(kMiddle, normal));
  return tissue;
}

const std::vector<std::vector<Vec3>> kCuts = {
    {},
    {{1, 0, 0}},
    {{0, 1, 0}},
    {{0, 0, 1}},
    {{1, 0.6, 0.3}},
    {{1, 0, 0}, {1, 0.06, 0.03}},  // a thin wedge
    {{1, 0.1, 0}, {0, 1, 0.2}, {0.1, 0.3, 1}},
    {{1, 0.1, 0}, {1, -0.1, 0.1}, {1, 0, -0.2}, {0.3, 1, 0}},  // and debris
};

TEST(Blocks, HaveEachPointOnceInACellWithTheNodesThatItSees) {
  for (std::size_t i = 0; i < kCuts.size(); ++i) {
    SCOPED_TRACE("cuts " + std::to_string(i));
    MpmTissue tissue = cut_box(kCuts[i]);
    const MpmState& s = tissue.state();
    std::vector<int> times(s.points.size(), 0);
    int wrong = 0;
    for (const Block* b : s.blocks.all) {
      for (std::size_t j = 0; j < b->lane_count(); ++j) {
        const std::int32_t p = b->point[j];
        if (p < 0) continue;
        ++times[p];
        const int row = static_cast<int>(j) / b->stride, z = row / 8, sub = row % 8;
        const int lowest = b->cell[j % b->stride];
        const Points::Site& site = s.points.site[p];
        wrong += site.x != 2 * b->cell_x(lowest % b->pitch) + (sub & 1);
        wrong += site.y != 2 * (b->y + lowest / b->pitch) + (sub >> 1 & 1);
        wrong += site.z != 2 * (b->z + z) + (sub >> 2);
        for (int k = 0; k < 27; ++k) {
          const int local = lowest + (z + k / 9) * b->plane + k / 3 % 3 * b->pitch + k % 3;
          wrong += b->node[local] != s.fields->node(s.bodies[site.body], site, k);
        }
      }
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(times, std::vector<int>(s.points.size(), 1));
  }
}

TEST(Blocks, KnowWhereTheirPointsAre) {
  for (std::size_t i = 0; i < kCuts.size(); ++i) {
    SCOPED_TRACE("cuts " + std::to_string(i));
    MpmTissue tissue = cut_box(kCuts[i]);
    MpmState& s = tissue.state();
    double worst = 0;
    for (const Block* b : s.blocks.all) {
      const std::size_t lanes = b->lane_count();
      std::vector<float> x(3 * lanes);
      s.kernels->positions(*b, block_field(s, *b), s.nodes.u, s.scratch.local(), x.data());
      for (std::size_t j = 0; j < lanes; ++j) {
        const std::int32_t p = b->point[j];
        if (p < 0) continue;
        const Points::Site& site = s.points.site[p];
        const reference::Stencil stencil = reference::stencil_of(s, p);
        Vec3 expected = s.bodies[site.body].site_position(site.x, site.y, site.z);
        for (int k = 0; k < 27; ++k) {
          for (int a = 0; a < 3; ++a) {
            expected[a] += stencil.weight[k] * s.nodes.u[a][stencil.node[k]];
          }
        }
        worst = std::max(worst, (Vec3(x[j], x[lanes + j], x[2 * lanes + j]) - expected).norm());
      }
    }
    EXPECT_LT(worst, 1e-5 * s.scene.cell_size) << "m";
  }
}

TEST(Blocks, TakeBothSidesOfACutTogether) {
  MpmTissue whole = cut_box({}), cut = cut_box({{1, 0, 0}});
  const auto count = [](MpmTissue& tissue, std::size_t sides) {
    const std::vector<Block*>& all = tissue.state().blocks.all;
    return std::count_if(all.begin(), all.end(),
                         [sides](const Block* b) { return b->sides.size() == sides; });
  };
  EXPECT_GT(count(whole, 1), 4);
  EXPECT_EQ(count(cut, 2), count(whole, 1));  // of each region, across which the cut goes
  EXPECT_EQ(count(cut, 1), 0);
}

}  // namespace
}  // namespace tissue_sim
