// What a set of cuts parts, found in independent ways.
#include "cut_kinds.h"

#include <gtest/gtest.h>

#include "rigid_modes.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.03, 0.02);

TEST(CutKinds, PartExactlyWhatTheirSurfacesPart) {
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    MpmTissue tissue(free_box(kSize, 0.002));
    const std::vector<Vec3> x = positions(tissue);
    for (const BladePath& path : kind.cuts) cut_now(tissue, path);
    std::vector<int> parts;
    for (const Vec3& place : x) parts.push_back(kind.part(place));
    EXPECT_EQ(labels(tissue), in_order(parts));
    EXPECT_EQ(static_cast<int>(tissue.fragments().size()), kind.pieces);
  }
}

TEST(CutKinds, HaveSixRigidModesForEachPieceAndNoOtherFreeMotion) {
  const Vec3 size(0.01, 0.008, 0.004);
  for (const CutKind& kind : cut_kinds(size)) {
    SCOPED_TRACE(kind.name);
    MpmTissue tissue(free_box(size, 0.002));
    for (const BladePath& path : kind.cuts) cut_now(tissue, path);
    EXPECT_EQ(static_cast<int>(tissue.fragments().size()), kind.pieces);
    EXPECT_GE(piece_sizes(tissue).back(), 4);
    EXPECT_EQ(rigid_modes(tissue.state()), 6 * kind.pieces);
  }
}

}  // namespace
}  // namespace tissue_sim
