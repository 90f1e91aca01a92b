// The fragment network on a GPU: says what it says on the CPU, and cracks begin where it expects
// them. Skipped where there is no GPU.
#if defined(TISSUE_SIM_CUDA)

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "fragments/torn_bar.h"
#include "support/either_device.h"
#include "support/network_text.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

const TemporaryFolder folder;
const std::string kNetwork = folder.write("network.yaml", network_text());

/// Where a crack is expected: from x = 6 to 8 mm.
float left(const MpmState& s, std::int32_t p, const float*) {
  const Points::Site& site = s.points.site[p];
  const double x = s.bodies[0].site_position(site.x, site.y, site.z).x();
  return x > 0.006 && x < 0.008 ? 0.9f : 0.1f;
}

template <class T>
std::unique_ptr<T> going_bar() {
  auto tissue = std::make_unique<T>(torn_bar(kNetwork));
  pull_apart(tissue->state());
  push(*tissue);
  return tissue;
}

TEST(PartingOnGpu, IsForeseenAsOnTheCpu) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  const auto cpu = going_bar<MpmTissue>();
  const auto gpu = going_bar<CudaMpmTissue>();
  int compared = 0;
  for (int frame = 0; frame < 30 && compared < 200; ++frame) {
    cpu->advance(1.0 / 960, {});
    gpu->advance(1.0 / 960, {});
    const FrameResult a = cpu->finish(), b = gpu->finish();
    EXPECT_EQ(a.fragment_candidates > 0, b.fragment_candidates > 0) << frame;
    for (const PartingChance& c : cpu->foresight().forecast) {
      const auto& of = gpu->foresight().forecast;
      const auto at = std::find_if(
          of.begin(), of.end(), [&](const PartingChance& other) { return other.point == c.point; });
      if (at == of.end()) continue;  // right at the share from which on points are candidates
      EXPECT_NEAR(c.probability, at->probability, 0.02) << frame << " " << c.point;
      ++compared;
    }
    EXPECT_NEAR(a.fragment_candidates, b.fragment_candidates, 0.1 * a.fragment_candidates + 8);
    if (a.tear_report.bonds_broken + b.tear_report.bonds_broken > 0) break;
  }
  EXPECT_GT(compared, 50);
}

TEST(PartingOnGpu, BeginsWhereItIsExpectedAndIsRestored) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  const auto tissue = going_bar<CudaMpmTissue>();
  tissue->foresight().classifier = left;
  CudaMpmTissue other(torn_bar(kNetwork));
  other.foresight().classifier = left;
  double where = -1;
  for (int frame = 0; frame < 16; ++frame) {
    tissue->advance(1.0 / 960, {});
    tissue->finish();
    if (frame > 0) {
      other.advance(1.0 / 960, {});
      other.finish();
      EXPECT_EQ(tissue->checksum(), other.checksum()) << frame;
    }
    const std::vector<std::uint8_t> saved = tissue->save();
    other.restore({saved.data(), saved.size()});
    const MpmState& s = tissue->state();
    for (std::int32_t p = 0; where < 0 && p < s.points.size(); ++p) {
      const Points::Site& site = s.points.site[p];
      if (broken_bonds(s, p) == 0) continue;
      where = s.bodies[0].site_position(site.x, site.y, site.z).x();
    }
  }
  EXPECT_TRUE(where > 0.005 && where < 0.0085) << where;
}

}  // namespace
}  // namespace tissue_sim

#endif
