// The fragment network on a GPU: says what it says on the CPU, and the same pieces fly. Skipped
// where there is no GPU.
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
const std::string kNetwork = folder.write("network.yaml", network_text(2));

template <class T>
std::unique_ptr<T> going_bar() {
  auto tissue = std::make_unique<T>(torn_bar(kNetwork));
  set_going(tissue->state());
  push(*tissue);
  return tissue;
}

TEST(FragmentsOnGpu, SayWhatTheySayOnTheCpu) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  const auto cpu = going_bar<MpmTissue>();
  const auto gpu = going_bar<CudaMpmTissue>();
  int compared = 0;
  for (int frame = 0; frame < 30 && compared < 200; ++frame) {
    cpu->advance(1.0 / 960, {});
    gpu->advance(1.0 / 960, {});
    const FrameResult a = cpu->finish(), b = gpu->finish();
    EXPECT_EQ(a.fragment_candidates > 0, b.fragment_candidates > 0) << frame;
    for (const FragmentChance& c : cpu->foresight().forecast) {
      const auto& of = gpu->foresight().forecast;
      const auto at = std::find_if(of.begin(), of.end(), [&](const FragmentChance& other) {
        return other.point == c.point;
      });
      if (at == of.end()) continue;  // right at the share from which on points are candidates
      EXPECT_NEAR(c.probability, at->probability, 0.02) << frame << " " << c.point;
      ++compared;
    }
    EXPECT_NEAR(a.fragment_candidates, b.fragment_candidates, 0.1 * a.fragment_candidates + 8);
    if (a.tear_report.bonds_broken + b.tear_report.bonds_broken > 0) break;
  }
  EXPECT_GT(compared, 50);
}

struct Flown {
  int first = -1;             ///< frame in which a piece first flew
  std::vector<double> sizes;  ///< of the pieces then, as shares, largest first
  int flying = 0;             ///< frames of pieces that fly
  Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero(), spin = Vec3::Zero();  ///< of the first then
  Momentum before, after;
};

template <class T>
Flown fly_bar() {
  const auto tissue = going_bar<T>();
  tissue->foresight().classifier = [](const MpmState&, std::int32_t, const float*) { return 0.9f; };
  Flown result;
  result.before = tissue->momentum();
  for (int frame = 0; frame < 30; ++frame) {
    tissue->advance(1.0 / 960, {});
    EXPECT_FALSE(tissue->finish().blew_up);
    if (result.first < 0 && tissue->foresight().flown > 0) {
      result.first = frame;
      double all = 0;
      for (const Fragment& f : tissue->fragments()) all += f.volume;
      for (const Fragment& f : tissue->fragments()) result.sizes.push_back(f.volume / all);
      std::sort(result.sizes.rbegin(), result.sizes.rend());
    }
    const auto& flights = tissue->state().flights;
    result.flying += static_cast<int>(flights.size());
    if (frame == result.first && !flights.empty()) {
      result.centre = flights[0].centre;
      result.velocity = flights[0].velocity;
      result.spin = flights[0].angular;
    }
  }
  result.after = tissue->momentum();
  return result;
}

TEST(FragmentsOnGpu, TheSamePiecesFly) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  const Flown cpu = fly_bar<MpmTissue>(), gpu = fly_bar<CudaMpmTissue>();
  ASSERT_GE(cpu.first, 0);
  EXPECT_NEAR(gpu.first, cpu.first, 1);
  ASSERT_EQ(gpu.sizes.size(), cpu.sizes.size());
  for (std::size_t i = 0; i < gpu.sizes.size(); ++i) {
    EXPECT_NEAR(gpu.sizes[i], cpu.sizes[i], 0.02) << i;
  }
  EXPECT_LT((gpu.centre - cpu.centre).norm(), 1e-3) << gpu.centre << "\n" << cpu.centre;
  EXPECT_LT((gpu.velocity - cpu.velocity).norm(), 0.05 * cpu.velocity.norm() + 0.01)
      << gpu.velocity << "\n"
      << cpu.velocity;
  EXPECT_LT((gpu.spin - cpu.spin).norm(), 0.1 * cpu.spin.norm()) << gpu.spin << "\n" << cpu.spin;
  EXPECT_GT(gpu.flying, 10);  // how long each flies, chance decides soon
  EXPECT_LT((gpu.after.linear - gpu.before.linear).norm(), 1e-3 * gpu.before.mass * 0.1);
  EXPECT_LT((gpu.after.angular - gpu.before.angular).norm(), 5e-3 * gpu.before.angular.norm());
}

/// Pieces fly in tissue that goes on as a copy of it which is restored then.
void goes_on_restored(CudaMpmTissue& tissue) {
  const auto sure = [](const MpmState&, std::int32_t, const float*) { return 0.9f; };
  tissue.foresight().classifier = sure;
  int frame = 0;
  for (; frame < 30 && tissue.foresight().flown == 0; ++frame) {
    tissue.advance(1.0 / 960, {});
    tissue.finish();
  }
  ASSERT_GT(tissue.foresight().flown, 0);
  const std::vector<std::uint8_t> saved = tissue.save();
  CudaMpmTissue other(torn_bar(kNetwork));
  other.foresight().classifier = sure;
  other.restore({saved.data(), saved.size()});
  for (int i = 0; i < 6; ++i) {
    tissue.advance(1.0 / 960, {});
    tissue.finish();
    other.advance(1.0 / 960, {});
    other.finish();
    EXPECT_EQ(tissue.checksum(), other.checksum()) << i;
  }
  EXPECT_EQ(tissue.foresight().flown, other.foresight().flown);
}

TEST(FragmentsOnGpu, AreRestored) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  goes_on_restored(*going_bar<CudaMpmTissue>());
}

TEST(FragmentsOnGpu, AreRestoredBesideTheFrontOfACut) {
  if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
  const auto tissue = going_bar<CudaMpmTissue>();
  cut_now(*tissue, upright_blade({Vec3(-0.01, 0.0041, 0), Vec3(0.0031, 0.0041, 0)}));
  goes_on_restored(*tissue);
  EXPECT_GT(tissue->state().front.nodes.size(), 0u);
}

}  // namespace
}  // namespace tissue_sim

#endif
