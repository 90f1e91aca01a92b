// Cutting on and on costs no more memory than there is tissue to cut.
//
// TISSUE_SIM_MANY_CUTS=1000000 tissue_sim_test --gtest_filter='ManyCuts.*' does as many sweeps.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <random>

#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

/// Memory of this process that lies in RAM [KiB]; 0 where it cannot be known.
long resident() {
  std::ifstream file("/proc/self/statm");
  long size = 0, pages = 0;
  file >> size >> pages;
  return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

struct Sizes {
  std::size_t nodes, splits, blocks, pieces, force, rows;

  explicit Sizes(MpmTissue& tissue) {
    const MpmState& s = tissue.state();
    nodes = s.nodes.size();
    splits = s.fields->split_count();
    blocks = s.blocks.all.size();
    pieces = tissue.fragments().size();
    force = s.work.force.size();
    rows = s.blocks.row_parts.size();
  }
  bool operator==(const Sizes& o) const {
    return nodes == o.nodes && splits == o.splits && blocks == o.blocks && pieces == o.pieces &&
           force == o.force && rows == o.rows;
  }
};

std::ostream& operator<<(std::ostream& out, const Sizes& s) {
  return out << s.nodes << " nodes, " << s.splits << " of the lattice split, " << s.blocks
             << " blocks, " << s.pieces << " pieces, " << s.force << " forces, " << resident()
             << " KiB";
}

const Vec3 kSize(0.008, 0.006, 0.006);

/// A short stroke somewhere in the body.
template <class Random>
BladePath stroke(Random& random) {
  std::uniform_real_distribution<double> u(-1, 1);
  const auto v = [&] { return Vec3(u(random), u(random), u(random)); };
  BladePath path;
  path.edge = {0.003 * v(), 0.003 * v()};
  const Vec3 from = 0.5 * kSize + 0.55 * v().cwiseProduct(kSize);
  path.poses = {{from, Quat::Identity()}, {from + 0.004 * v(), Quat::Identity()}};
  return path;
}

void cut_at_random(MpmTissue& tissue, int sweeps, std::mt19937& random) {
  for (int i = 0; i < sweeps; ++i) {
    const BladePath path = stroke(random);
    advance_by(tissue, 0, 1e-4f, {{}, {&path, 1}});
  }
  tissue.finish();
}

int bonds(MpmTissue& tissue) {
  int count = 0;
  for (const std::uint8_t b : tissue.state().points.bonds) count += __builtin_popcount(b);
  return count / 2;
}

TEST(ManyCuts, DoNotLeak) {
  const char* wish = std::getenv("TISSUE_SIM_MANY_CUTS");
  const int sweeps = wish == nullptr ? 3000 : std::atoi(wish);
  MpmTissue tissue(free_box(kSize, 0.002));
  std::mt19937 random(1);
  const Sizes whole(tissue);
  const auto start = std::chrono::steady_clock::now();
  std::cout << "whole: " << whole << "\n";
  const int points = tissue.point_count();
  cut_at_random(tissue, 60, random);
  // Whatever is cut, a point sees 27 nodes, and a node that none sees there is not.
  const Sizes some(tissue);
  std::cout << "60 sweeps, " << bonds(tissue) << " bonds left: " << some << "\n";
  EXPECT_LE(some.nodes, whole.nodes + 27u * points);
  EXPECT_LE(some.splits, whole.nodes);
  EXPECT_LE(some.pieces, static_cast<std::size_t>(points));
  cut_at_random(tissue, sweeps / 2, random);
  // Every bond that is left, plane by plane: nothing more can come apart.
  for (int axis = 0; axis < 3; ++axis) {
    for (double x = 0.001; x < kSize[axis]; x += 0.001) {
      cut_now(tissue, plane_cut(x * Vec3::Unit(axis), Vec3::Unit(axis)));
    }
  }
  EXPECT_EQ(bonds(tissue), 0);
  const Sizes dust(tissue);
  const long memory = resident();
  std::cout << "dust: " << dust << "\n";
  EXPECT_EQ(dust.pieces, static_cast<std::size_t>(points));
  cut_at_random(tissue, sweeps - sweeps / 2 - 60, random);
  std::cout << sweeps << " sweeps, "
            << std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()
            << " s: " << Sizes(tissue) << "\n";
  EXPECT_EQ(Sizes(tissue), dust);
  EXPECT_LE(resident() - memory, 1024) << "[KiB]";
}

TEST(ManyCuts, ThroughTissueThatIsPartlyCutSettleAtASize) {
  // Strokes in one plane: after some hundred of them there is nothing left to part in it.
  MpmTissue tissue(free_box(kSize, 0.002));
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(-0.01, 0.02);
  const auto strokes = [&](int count) {
    for (int i = 0; i < count; ++i) {
      cut_now(tissue, upright_blade({Vec3(0.006, u(random), 0), Vec3(0.006, u(random), 0)}));
    }
  };
  strokes(100);
  const Sizes cut(tissue);
  EXPECT_EQ(cut.pieces, 2u);
  const long memory = resident();
  strokes(1000);
  EXPECT_EQ(Sizes(tissue), cut);
  EXPECT_LE(resident() - memory, 1024) << "[KiB]";
}

}  // namespace
}  // namespace tissue_sim
