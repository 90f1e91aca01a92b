// Pieces of pieces: who came from whom, and what a consumer can follow.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.02, 0.02);

std::map<int, Fragment> by_id(Tissue& tissue) {
  std::map<int, Fragment> result;
  for (const Fragment& f : tissue.fragments()) {
    EXPECT_TRUE(result.emplace(f.id, f).second) << "id " << f.id << " twice";
  }
  return result;
}

TEST(FragmentHistory, ChainsOverThreeGenerations) {
  MpmTissue tissue(free_box(kSize, 0.002));
  const auto cut_at = [&](double x) {
    return cut_now(tissue, plane_cut(Vec3(x, 0, 0), Vec3::UnitX())).new_fragments;
  };
  EXPECT_EQ(cut_at(0.022), std::vector<int>{1});  // the right is the smaller part
  EXPECT_EQ(cut_at(0.032), std::vector<int>{2});  // of it the right again
  EXPECT_EQ(cut_at(0.037), std::vector<int>{3});
  const std::map<int, Fragment> pieces = by_id(tissue);
  ASSERT_EQ(pieces.size(), 4u);
  EXPECT_EQ(pieces.at(0).parent, -1);
  EXPECT_EQ(pieces.at(1).parent, 0);
  EXPECT_EQ(pieces.at(2).parent, 1);
  EXPECT_EQ(pieces.at(3).parent, 2);
  const double widths[] = {0.022, 0.010, 0.005, 0.003};
  for (int id = 0; id < 4; ++id) {
    EXPECT_NEAR(pieces.at(id).volume, widths[id] * 4e-4, 1e-10) << "piece " << id;
    EXPECT_TRUE(id == 0 || pieces.at(id).loose);
  }
}

TEST(FragmentHistory, LargestPartKeepsTheIdAndOfEqualsTheFirst) {
  MpmTissue tissue(free_box(kSize, 0.002));
  cut_now(tissue, plane_cut(Vec3(0.01, 0, 0), Vec3::UnitX()));
  EXPECT_NEAR(by_id(tissue).at(0).centroid.x(), 0.025, 1e-6);
  cut_now(tissue, plane_cut(Vec3(0.025, 0, 0), Vec3::UnitX()));
  EXPECT_NEAR(by_id(tissue).at(0).centroid.x(), 0.0175, 1e-6);
  EXPECT_NEAR(by_id(tissue).at(2).centroid.x(), 0.0325, 1e-6);
}

TEST(FragmentHistory, CanBeFollowedFromFrameToFrameHoweverMuchIsCut) {
  MpmTissue tissue(free_box(kSize, 0.002));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-1, 1);
  std::map<int, Fragment> before = by_id(tissue);
  std::vector<int> was(tissue.point_count(), 0);
  int newest = 0;
  for (int frame = 0; frame < 8; ++frame) {
    std::vector<BladePath> cuts;  // several in one frame
    for (int i = 0; i < 1 + frame % 3; ++i) {
      const Vec3 place =
          0.5 * kSize + 0.4 * Vec3(u(random), u(random), u(random)).cwiseProduct(kSize);
      cuts.push_back(plane_cut(place, Vec3(u(random), u(random), u(random))));
    }
    advance_by(tissue, 0, 1e-4f, {{}, cuts});
    std::vector<int> fresh;
    for (const CutReport& r : tissue.finish().cut_reports) {
      fresh.insert(fresh.end(), r.new_fragments.begin(), r.new_fragments.end());
    }
    const std::map<int, Fragment> now = by_id(tissue);
    for (const auto& [id, f] : before) {
      ASSERT_TRUE(now.count(id)) << "piece " << id << " is gone";
      EXPECT_EQ(now.at(id).parent, f.parent) << "piece " << id << " changed its parent";
    }
    std::vector<int> appeared;
    for (const auto& [id, f] : now) {
      if (before.count(id)) continue;
      EXPECT_GT(id, newest) << "an id is used again";
      EXPECT_TRUE(now.count(f.parent)) << "the parent of " << id << " is not listed";
      EXPECT_LT(f.parent, id);
      appeared.push_back(id);
    }
    EXPECT_EQ(appeared, fresh) << "what the reports say";
    newest = now.rbegin()->first;
    double volume = 0;
    for (const auto& [id, f] : now) volume += f.volume;
    EXPECT_NEAR(volume, kSize.prod(), 1e-6 * kSize.prod());
    for (int p = 0; p < tissue.point_count(); ++p) {
      // Up the parents of the piece that a point is in now, the one that it was in comes up.
      int id = tissue.fragment_of(p);
      while (id != was[p] && id >= 0) id = now.at(id).parent;
      ASSERT_EQ(id, was[p]) << "point " << p << " in frame " << frame;
      was[p] = tissue.fragment_of(p);
    }
    before = now;
  }
  EXPECT_GT(before.size(), 40u);
}

TEST(FragmentHistory, APieceThatFallsIsCutAgain) {
  Scene scene = free_box(Vec3(0.04, 0.02, 0.03), 0.002);
  scene.gravity = Vec3(0, 0, -9.81);
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, 0.024);
  held.max = Vec3(1, 1, 1);
  scene.bodies[0].anchors = {held};
  Simulation simulation(scene);
  simulation.cut(plane_cut(Vec3(0, 0, 0.013), Vec3::UnitZ()));
  for (int i = 0; i < 6; ++i) simulation.advance_frame();
  const Fragment falling = by_id(simulation.tissue()).at(1);
  EXPECT_EQ(falling.parent, 0);
  EXPECT_TRUE(falling.loose);
  EXPECT_NEAR(falling.velocity.z(), -0.981, 0.01);
  BladePath short_blade = plane_cut(falling.centroid + Vec3(0.005, 0, 0), Vec3::UnitX());
  short_blade.edge = {Vec3(0, 0, -0.02), Vec3(0, 0, 0.02)};  // does not reach what still hangs
  simulation.cut(short_blade);
  EXPECT_EQ(simulation.advance_frame().result.cut_reports[0].new_fragments, std::vector<int>{2});
  const std::map<int, Fragment> pieces = by_id(simulation.tissue());
  EXPECT_EQ(pieces.at(2).parent, 1);
  EXPECT_TRUE(pieces.at(2).loose);
  EXPECT_FALSE(pieces.at(0).loose);
  EXPECT_NEAR(pieces.at(2).volume, 15.0 / 40 * falling.volume, 0.03 * falling.volume);
  for (int i = 0; i < 2; ++i) simulation.advance_frame();
  for (const int id : {1, 2}) {
    EXPECT_NEAR(by_id(simulation.tissue()).at(id).velocity.z(), -9.81 * 9 / 60, 0.015);
  }
}

}  // namespace
}  // namespace tissue_sim
