// Enrichment in the plane: the paper's figures 4 to 6, and what it says of its own form.
#include "paper/enrichment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/curve_file.h"

namespace tissue_sim {
namespace {

const CutSegment2 kCut = {{-0.5, 0}, {0.5, 0}};

/// A cut with a corner, and one that turns twice.
std::vector<CutSegment2> chain(const std::vector<Vec2>& corners) {
  std::vector<CutSegment2> segments;
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
    segments.push_back({corners[i], corners[i + 1]});
  }
  return segments;
}
const std::vector<std::vector<Vec2>> kChains = {
    {{-0.5, -0.1}, {0.0, 0.2}, {0.5, -0.1}},
    {{-0.6, -0.2}, {-0.2, 0.15}, {0.1, -0.15}, {0.6, 0.1}},
    {{-0.6, 0.3}, {-0.3, 0.0}, {0.2, -0.1}, {0.5, -0.3}, {0.7, 0.1}}};

/// Which side of the chain a place within its reach is on, seen across the direction `angle`; 0 for
/// places beside it.
int true_side(const std::vector<CutSegment2>& chain, double angle, const Vec2& x) {
  const auto turned = [angle](const Vec2& p) {
    return Vec2(std::cos(angle) * p.x() + std::sin(angle) * p.y(),
                -std::sin(angle) * p.x() + std::cos(angle) * p.y());
  };
  const Vec2 at = turned(x);
  for (const CutSegment2& s : chain) {
    const Vec2 a = turned(s.a), b = turned(s.b);
    if (at.x() <= a.x() || at.x() >= b.x()) continue;
    return at.y() > a.y() + (at.x() - a.x()) / (b.x() - a.x()) * (b.y() - a.y()) ? 1 : -1;
  }
  return 0;
}

TEST(MlsEnrichment, HasASignOnEachSide) {
  for (const double t : {-0.49, 0.0, 0.3}) {
    EXPECT_EQ(enrichment(kCut, {t, 1e-3}), 1);
    EXPECT_EQ(enrichment(kCut, {t, -1e-3}), -1);
    EXPECT_EQ(enrichment(kCut, {t, 2}), 1);
  }
  EXPECT_EQ(enrichment(kCut, {0.7, 0}), 0);
  EXPECT_NEAR(enrichment(kCut, {0.8, 0.3}), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(beyond_ends(0.2, -1, 1), 0);
  EXPECT_NEAR(beyond_ends(1.5, -1, 1), 0.5, 1e-15);
  EXPECT_NEAR(beyond_ends(-1.25, -1, 1), 0.25, 1e-15);
}

TEST(MlsEnrichment, IsSmoothAroundTips) {
  // On a circle around a tip it goes from 1 to -1 on the side away from the cut, in steps that
  // shrink with those of the angle.
  double before = enrichment(kCut, {0.5, 0.1}), largest = 0;
  const int steps = 1000;
  for (int k = 1; k <= steps; ++k) {
    const double angle = M_PI / 2 - M_PI * k / steps;
    const double h = enrichment(kCut, Vec2(0.5 + 0.1 * std::cos(angle), 0.1 * std::sin(angle)));
    largest = std::max(largest, std::fabs(h - before));
    before = h;
  }
  EXPECT_EQ(before, -1);
  EXPECT_LT(largest, 1.1 * M_PI / steps);
}

TEST(MlsEnrichment, SharesAreWholeOnOneSideAndNothingAcross) {
  EXPECT_EQ(enriched_share(1, 1), 1);
  EXPECT_EQ(enriched_share(-1, -1), 1);
  EXPECT_EQ(enriched_share(1, -1), 0);
  EXPECT_EQ(enriched_share(0.3, 0), 0.5);
  EXPECT_EQ(enriched_share(0.5, -1), 0.5 * (1 - 0.25));
  EXPECT_EQ(enriched_share(-0.4, 0.9), enriched_share(0.9, -0.4));
}

TEST(MlsEnrichment, OfOneSegmentIsTheSameExtended) {
  const CutSegment2 cut{{0.1, -0.2}, {0.7, 0.3}};
  const ExtendedEnrichment extended({cut});
  for (double x = -1; x < 1.5; x += 0.13) {
    for (double y = -1; y < 1; y += 0.17) {
      EXPECT_NEAR(extended({x, y}), enrichment(cut, {x, y}), 1e-12);
    }
  }
}

// Weights between a node above the chain and places beside it: a share above a half across the cut,
// or below on the node's own side, is wrong.
TEST(MlsEnrichment, ProductsAreWrongBehindCornersAndTheExtendedFormIsNot) {
  for (std::size_t c = 0; c < kChains.size(); ++c) {
    const std::vector<CutSegment2> cuts = chain(kChains[c]);
    const ExtendedEnrichment extended(cuts);
    CurveFile file("enrichment_" + std::to_string(c),
                   "x [m],y [m],multiplied [-],extended [-],region [-]");
    CurveFile corners("enrichment_cut_" + std::to_string(c), "x [m],y [m]");
    for (const Vec2& x : kChains[c]) corners.add({x.x(), x.y()});
    const Vec2 node(0.05, 0.6);
    ASSERT_EQ(true_side(cuts, extended.angle(), node), 1);
    const double own_product = multiplied_enrichment(cuts, node), own = extended(node);
    int places = 0, wrong_product = 0, wrong_extended = 0;
    for (double y = -0.995; y < 1; y += 0.01) {
      for (double x = -0.995; x < 1; x += 0.01) {
        const Vec2 at(x, y);
        const double product = multiplied_enrichment(cuts, at), whole = extended(at);
        file.add({x, y, product, whole, static_cast<double>(extended.region(at))});
        const int side = true_side(cuts, extended.angle(), at);
        if (side == 0) continue;
        ++places;
        wrong_product += (enriched_share(own_product, product) > 0.5) != (side > 0);
        wrong_extended += (enriched_share(own, whole) > 0.5) != (side > 0);
      }
    }
    std::printf(
        "chain %zu: %d of %d weights wrong in the multiplicative form, %d in the extended\n", c,
        wrong_product, places, wrong_extended);
    EXPECT_GT(wrong_product, places / 100) << "chain " << c;
    EXPECT_EQ(wrong_extended, 0) << "chain " << c;
  }
}

TEST(MlsEnrichment, RefusesChainsThatTurnBack) {
  const auto refused = [](const std::vector<Vec2>& corners) {
    EXPECT_THROW(ExtendedEnrichment{chain(corners)}, std::invalid_argument);
  };
  refused({});
  refused({{0, 0}, {0, 0}});
  refused({{0, 0}, {1, 0}, {1, 1}, {0, 1}});    // hooked
  refused({{0, 0}, {1, 0}, {0.5, 1}, {0, 0}});  // closed
  EXPECT_THROW(ExtendedEnrichment({{{0, 0}, {1, 0}}, {{1.1, 0}, {2, 0}}}), std::invalid_argument);
}

}  // namespace
}  // namespace tissue_sim
