// How tissue is divided for a GPU. Needs none.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <array>
#include <numeric>

#include "mpm/cuda/choose_plan.h"

namespace tissue_sim {
namespace {

/// A body on its lattice, and the blocks that it is divided into.
struct Divided : LatticeTissue {
  Scene scene;

  explicit Divided(Shape shape, const Vec3& size = Vec3(0.021, 0.017, 0.012)) {
    scene.cell_size = 0.001;
    scene.bodies.resize(1);
    Body& body = scene.bodies[0];
    body.shape = shape;
    body.size = size;
    body.radii = Vec3(0.016, 0.011, 0.0075);
    std::vector<std::string> notes;
    bodies = make_lattice_bodies(scene, points, &notes, NodeRange::kBox);
    fields = std::make_unique<NodeFields>(bodies, points, nodes);
  }
  std::vector<BlockToBundle> blocks(int x, int y, int z) {
    Cpu cpu(1);
    BlockShape of;
    of.x = x, of.y = y, of.z = z;
    of.uniform = true;
    of.has_rows = false;
    const Blocks all = make_blocks(*this, of, cpu);
    return blocks_to_bundle(all.all);
  }
};

int columns_of(const std::vector<BlockToBundle>& blocks) {
  return std::accumulate(blocks.begin(), blocks.end(), 0,
                         [](int sum, const BlockToBundle& b) { return sum + b.size.columns; });
}

TEST(BlockCounts, AreThoseOfTheBlocksThatAreMade) {
  for (const Shape shape : {Shape::kBox, Shape::kEllipsoid}) {
    Divided divided(shape);
    const BlockCounts counts(divided.bodies[0], 256, 16);
    EXPECT_EQ(counts.fills_box(), shape == Shape::kBox);
    for (const auto [x, y, z] : {std::array{16, 16, 8}, {5, 4, 1}, {7, 3, 5}, {64, 2, 16}}) {
      const std::vector<BlockToBundle> made = divided.blocks(x, y, z);
      const BlockCount count = counts.count(x, y, z);
      EXPECT_EQ(count.blocks, made.size()) << x << ' ' << y << ' ' << z;
      EXPECT_EQ(count.columns, columns_of(made)) << x << ' ' << y << ' ' << z;
      std::vector<BlockToBundle> listed;
      counts.list(x, y, z, 0, listed);
      ASSERT_EQ(listed.size(), made.size());
      for (std::size_t i = 0; i < made.size(); ++i) {
        EXPECT_EQ(listed[i].size.columns, made[i].size.columns);
        EXPECT_EQ(listed[i].size.plane_slots, made[i].size.plane_slots);
        EXPECT_GE(listed[i].size.slots, made[i].size.slots);  // layers without points left out
      }
    }
  }
}

TEST(BundleBlocks, KeepsEachBlockOnceAndTheLimits) {
  Divided divided(Shape::kEllipsoid);
  std::vector<BlockToBundle> blocks = divided.blocks(8, 8, 3);
  blocks[blocks.size() / 2].kind = 1;
  const BundleSize limits = {64, 150, 500};
  const std::size_t at_once = 5;
  const auto bundles = bundle_in_rounds(blocks, at_once, blocks.size(), limits);
  ASSERT_FALSE(bundles.empty());
  EXPECT_LT(bundles.size(), blocks.size());
  EXPECT_GE(bundles.size(), fewest_bundles(blocks, limits));
  std::vector<int> times(blocks.size(), 0);
  for (const std::vector<int>& bundle : bundles) {
    BundleSize size = {};
    for (const int i : bundle) {
      ++times[i];
      EXPECT_EQ(blocks[i].kind, blocks[bundle[0]].kind);
      size.columns += blocks[i].size.columns;
      size.plane_slots += blocks[i].size.plane_slots;
      size.slots += blocks[i].size.slots;
    }
    EXPECT_LE(size.columns, limits.columns);
    if (bundle.size() == 1) continue;  // alone, a block may be as large as it is
    EXPECT_LE(size.plane_slots, limits.plane_slots);
    EXPECT_LE(size.slots, limits.slots);
  }
  for (const int n : times) EXPECT_EQ(n, 1);
  // Fewer than all there is room for: none, and with room for each, none that share.
  EXPECT_TRUE(bundle_in_rounds(blocks, at_once, at_once, limits).empty());
  EXPECT_TRUE(bundle_in_rounds(blocks, blocks.size(), blocks.size(), limits).empty());
}

TEST(ChooseShape, BlocksOfAnOrganRunAtOnceWhereTheyCan) {
  // 3400 cells on 132 multiprocessors: every block has one of its own, or shares it.
  Divided divided(Shape::kEllipsoid);
  const CudaShape shape = choose_shape(divided.bodies, {132, 232448}, false);
  EXPECT_TRUE(shape.small);
  const auto blocks = divided.blocks(shape.blocks.x, shape.blocks.y, shape.blocks.z);
  const BundleSize limits = {shape.columns(),
                             most_plane_slots((shape.blocks.x + 2) * (shape.blocks.y + 2)), 2000};
  EXPECT_TRUE(blocks.size() <= 132 || !bundle_in_rounds(blocks, 132, 132, limits).empty());
  EXPECT_GE(blocks.size(), 60u);  // and enough of them have one
}

TEST(ChooseShape, LeavesRoomForBlocksThatCutsAdd) {
  constexpr int kProcessors = 132;
  int all_used = 0;
  for (int x = 16; x <= 40; x += 4) {
    for (int y = 8; y <= x; y += 4) {
      Divided divided(Shape::kBox, 0.001 * Vec3(x, y, 12));
      const auto count = [&](bool whole) {
        const CudaShape shape = choose_shape(divided.bodies, {kProcessors, 232448}, whole);
        return divided.blocks(shape.blocks.x, shape.blocks.y, shape.blocks.z).size();
      };
      // As long as it is whole a body may have all of them.
      all_used += count(true) > kProcessors / 1.1 && count(true) <= kProcessors ? 1 : 0;
      const std::size_t blocks = count(false);
      EXPECT_TRUE(1.1 * blocks <= kProcessors || blocks > kProcessors) << x << " x " << y;
    }
  }
  EXPECT_GT(all_used, 5);
}

}  // namespace
}  // namespace tissue_sim
#endif
