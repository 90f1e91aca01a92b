// What a set of cuts parts, by the stiffness of what is left.
#include "support/cut_kinds.h"

#include <gtest/gtest.h>

#include "support/cut_scenes.h"
#include "support/rigid_modes.h"

namespace tissue_sim {
namespace {

TEST(PiecesOfCutKinds, HaveSixRigidModesForEachPieceAndNoOtherFreeMotion) {
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
