// Cracks begin where a fragment network expects them.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "fragments/torn_bar.h"
#include "mpm/mpm_tissue.h"
#include "support/network_text.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

const TemporaryFolder folder;
const std::string kNetwork = folder.write("network.yaml", network_text());

struct Torn {
  double where = -1;  ///< x of the first bond that tore, in reference space [m]
  int when = -1;      ///< frame
  int looked_at = 0, expected = 0;
  std::vector<std::uint64_t> checksums;
};

/// A bar that is pulled apart evenly; a crack is expected from x = `from` to `to`.
Torn tear_bar(double from, double to, int threads = 1, bool restored = false,
              const std::string& network = kNetwork) {
  Scene scene = torn_bar(network);
  scene.threads = threads;
  const PartingClassifier classifier = [=](const MpmState& s, std::int32_t p, const float*) {
    const Points::Site& site = s.points.site[p];
    const double x = s.bodies[0].site_position(site.x, site.y, site.z).x();
    return x > from && x < to ? 0.9f : 0.1f;
  };
  auto tissue = std::make_unique<MpmTissue>(scene);
  tissue->foresight().classifier = classifier;
  pull_apart(tissue->state());
  measure_motion(tissue->state());
  Torn torn;
  for (int frame = 0; frame < 16; ++frame) {
    if (restored && torn.expected > 0) {
      const std::vector<std::uint8_t> saved = tissue->save();
      tissue = std::make_unique<MpmTissue>(scene);
      tissue->foresight().classifier = classifier;
      tissue->restore({saved.data(), saved.size()});
      restored = false;
    }
    tissue->advance(1.0 / 960, {});
    const FrameResult result = tissue->finish();
    EXPECT_FALSE(result.blew_up);
    torn.looked_at += result.fragment_candidates;
    torn.expected += result.fragment_points;
    torn.checksums.push_back(tissue->checksum());
    const MpmState& s = tissue->state();
    for (std::int32_t p = 0; torn.when < 0 && p < s.points.size(); ++p) {
      if (broken_bonds(s, p) == 0) continue;
      const Points::Site& site = s.points.site[p];
      torn.where = s.bodies[0].site_position(site.x, site.y, site.z).x();
      torn.when = frame;
    }
  }
  return torn;
}

TEST(PartingForeseen, CracksBeginWhereTheyAreExpected) {
  const Torn plain = tear_bar(1, 1), low = tear_bar(0.006, 0.008), high = tear_bar(0.013, 0.015);
  EXPECT_GT(plain.looked_at, 0);
  EXPECT_EQ(plain.expected, 0);
  ASSERT_GE(plain.when, 0);
  EXPECT_TRUE(plain.where > 0.008 && plain.where < 0.013) << plain.where;
  EXPECT_GT(low.expected, 0);
  EXPECT_TRUE(low.where > 0.005 && low.where < 0.0085) << low.where;
  EXPECT_TRUE(high.where > 0.0125 && high.where < 0.0155) << high.where;
  EXPECT_EQ(low.when, plain.when) << "not before tissue is past its limit";
}

TEST(PartingForeseen, ChangesNoBitsWhereNothingIsExpected) {
  EXPECT_EQ(tear_bar(1, 1).checksums, tear_bar(1, 1, 1, false, "off").checksums);
}

TEST(PartingForeseen, BitsAreTheSame) {
  const Torn one = tear_bar(0.006, 0.008), two = tear_bar(0.006, 0.008, 2),
             restored = tear_bar(0.006, 0.008, 1, true);
  EXPECT_EQ(one.checksums, two.checksums);
  EXPECT_EQ(one.checksums, restored.checksums);
}

}  // namespace
}  // namespace tissue_sim
