// Regions that a cut goes through, halved where there is room for their blocks.
#include <gtest/gtest.h>

#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

const Vec3 kMiddle(0.0155, 0.0145, 0.0085);

/// In how many blocks each point is.
std::vector<int> count_points(const MpmState& s) {
  std::vector<int> count(s.points.size(), 0);
  for (const Block* block : s.blocks.all) {
    for (const std::int32_t p : block->point) {
      if (p >= 0) ++count[p];
    }
  }
  return count;
}

TEST(HalvedRegions, HoldEachPointOnceAndOnlyWhereThereIsRoom) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
  for (const int room : {0, 1, 1000}) {
    SCOPED_TRACE(room);
    MpmTissue tissue(scene);
    const MpmState& s = tissue.state();
    tissue.state().blocks.room = room;
    for (const Vec3& normal : {Vec3(1, 0.6, 0.3), Vec3(0.2, 1, 0.1), Vec3(0.2, 0.1, 1)}) {
      EXPECT_GT(cut_now(tissue, plane_cut(kMiddle, normal)).bonds_broken, 0);
      EXPECT_EQ(s.blocks.has_halves(), room == 1000);
      for (const int count : count_points(s)) ASSERT_EQ(count, 1);
    }
  }
}

TEST(HalvedRegions, MoveAsWholeOnes) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kBox);
  const auto run = [&](int room) {
    MpmTissue tissue(scene);
    tissue.state().blocks.room = room;
    deform(tissue.state());
    shake(tissue.state(), 7, 2e-5);
    EXPECT_GT(cut_now(tissue, plane_cut(kMiddle, Vec3(1, 0.6, 0.3))).bonds_broken, 0);
    advance_by(tissue, 40, 0.3f * tissue.stable_substep(), {});
    tissue.finish();
    EXPECT_EQ(tissue.state().blocks.has_halves(), room > 0);
    return positions(tissue);
  };
  const auto whole = run(0), halved = run(1000);
  ASSERT_EQ(whole.size(), halved.size());
  for (std::size_t p = 0; p < whole.size(); ++p) {
    ASSERT_LT((whole[p] - halved[p]).norm(), 1e-7) << "point " << p;
  }
}

}  // namespace
}  // namespace tissue_sim
