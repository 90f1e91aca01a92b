// What cuts of every kind part: pieces, which points they hold, how large they are.
#include "support/cut_kinds.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.03, 0.02);

class CutKinds : public EachMethod {
 protected:
  /// Which of the first `count` points tell what is parted: all, but of a mesh not the vertices on
  /// the wound. They belong to both sides, and move onto it.
  std::vector<bool> telling(Tissue& tissue, std::size_t count) const {
    std::vector<bool> tell(count, true);
    if (GetParam().method != Method::kPbd) return tell;
    for (const Point& p : points_of(tissue)) {
      if (p.id < count && p.damage > 0) tell[p.id] = false;
    }
    return tell;
  }
};
FOR_EACH_METHOD(CutKinds);

template <class T>
std::vector<T> those(const std::vector<T>& all, const std::vector<bool>& which) {
  std::vector<T> kept;
  for (std::size_t i = 0; i < which.size(); ++i) {
    if (which[i]) kept.push_back(all[i]);
  }
  return kept;
}

/// All cuts at the beginning of one frame, of a body at rest.
FrameResult cut(Simulation& simulation, const std::vector<BladePath>& paths) {
  for (const BladePath& path : paths) simulation.cut(path);
  return simulation.advance_frame().result;
}

/// Share of the points that are in another part than most of their piece.
double misplaced(const std::vector<int>& pieces, const std::vector<int>& parts) {
  std::vector<std::vector<int>> counts;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    counts.resize(std::max<std::size_t>(counts.size(), pieces[i] + 1));
    auto& count = counts[pieces[i]];
    count.resize(std::max<std::size_t>(count.size(), parts[i] + 1));
    ++count[parts[i]];
  }
  int at_home = 0;
  for (const auto& count : counts) at_home += *std::max_element(count.begin(), count.end());
  return 1 - double(at_home) / double(pieces.size());
}

/// Volume of each part of the box [m^3], by a fine grid of places.
std::vector<double> volumes(const CutKind& kind) {
  constexpr int kAcross = 60;
  std::vector<double> result(kind.pieces);
  const double share = kSize.prod() / (kAcross * kAcross * kAcross);
  for (int i = 0; i < kAcross; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      for (int k = 0; k < kAcross; ++k) {
        const Vec3 x = (Vec3(i, j, k) + Vec3::Constant(0.5)) / kAcross;
        result.at(kind.part(x.cwiseProduct(kSize))) += share;
      }
    }
  }
  std::sort(result.begin(), result.end());
  return result;
}

TEST_P(CutKinds, PartWhatTheirSurfacesPart) {
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    Simulation simulation(on_this(free_box(kSize, 0.002)));
    std::vector<int> parts;
    for (const Vec3& place : positions(simulation.tissue())) parts.push_back(kind.part(place));
    const FrameResult result = cut(simulation, kind.cuts);
    EXPECT_GT(result.cut_reports[0].points_separated, 0);
    const std::vector<int> pieces = labels(simulation.tissue());
    EXPECT_EQ(1 + *std::max_element(pieces.begin(), pieces.end()), kind.pieces);
    const std::vector<bool> tell = telling(simulation.tissue(), parts.size());
    EXPECT_LE(misplaced(those(pieces, tell), in_order(those(parts, tell))), within().misplaced);

    std::vector<double> sizes;
    int points = 0;
    for (const Fragment& f : simulation.tissue().fragments()) {
      sizes.push_back(f.volume);
      points += f.point_count;
    }
    std::sort(sizes.begin(), sizes.end());
    EXPECT_EQ(points, simulation.tissue().point_count());
    const std::vector<double> expected = volumes(kind);
    ASSERT_EQ(sizes.size(), expected.size());
    double all = 0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      EXPECT_NEAR(sizes[i], expected[i], within().volume * kSize.prod()) << "piece " << i;
      all += sizes[i];
    }
    EXPECT_NEAR(all, kSize.prod(), 1e-5 * kSize.prod());
  }
}

// However many poses a sweep has, and in however many frames it is made.
TEST_P(CutKinds, SlowPartsWhatFastParts) {
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    constexpr int kSteps = 8;
    Simulation fast(on_this(free_box(kSize, 0.002))), slow(on_this(free_box(kSize, 0.002)));
    const int points = fast.tissue().point_count();
    cut(fast, kind.cuts);
    for (const BladePath& path : kind.cuts) {
      for (std::size_t i = 0; i + 1 < path.poses.size(); ++i) {
        const Pose &a = path.poses[i], &b = path.poses[i + 1];
        for (int step = 0; step < kSteps; ++step) {
          const auto between = [&](double s) -> Pose {
            return {a.position + s * (b.position - a.position),
                    a.orientation.slerp(s, b.orientation)};
          };
          BladePath part{path.edge,
                         {between(double(step) / kSteps), between((step + 1.0) / kSteps)}};
          slow.cut(part);
        }
        if (i % 8 == 0) slow.advance_frame();
      }
    }
    slow.advance_frame();
    const std::vector<bool> tell = telling(fast.tissue(), points);
    EXPECT_EQ(tell, telling(slow.tissue(), points));
    EXPECT_EQ(in_order(those(labels(slow.tissue()), tell)),
              in_order(those(labels(fast.tissue()), tell)));
    EXPECT_EQ(static_cast<int>(slow.tissue().fragments().size()), kind.pieces);
  }
}

// A cut leaves what it parts where it was, without a force.
TEST_P(CutKinds, MoveNothing) {
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    Simulation simulation(on_this(free_box(kSize, 0.002)));
    const std::vector<Vec3> before = positions(simulation.tissue());
    cut(simulation, kind.cuts);
    const FrameResult result = simulation.advance_frame().result;
    EXPECT_TRUE(
        is_at_most("what a cut at rest moves", result.max_speed, within().cut_speed, "m/s"));
    EXPECT_TRUE(is_at_most("its energy", result.elastic_energy, within().cut_energy, "J"));
    double moved = 0;
    const std::vector<Vec3> after = positions(simulation.tissue());
    const std::vector<bool> tell = telling(simulation.tissue(), before.size());
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (!tell[i]) continue;
      moved = std::max(moved, (after[i] - before[i]).norm());
    }
    EXPECT_LE(moved, 1e-7);
  }
}

}  // namespace
}  // namespace tissue_sim
