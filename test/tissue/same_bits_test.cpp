// The same scene and the same inputs give the same bits, frame by frame, whatever the number of
// threads.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <set>
#include <vector>

#include "support/test_scenes.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class SameBits : public EachMethod {
 protected:
  /// Liver on the ground, held at one end; a scalpel that goes through it and a probe that pushes.
  Scene operation(int threads) const {
    Scene s = on_this(operation_scene(Vec3(0.08, 0.048, 0.028), Vec3(0, 0, 0.015)));
    s.threads = threads;
    return s;
  }
};
FOR_EACH_METHOD(SameBits);

struct Operation {
  std::vector<std::uint64_t> checksums;  ///< of each frame
  std::int64_t bonds_broken = 0;
  double push = 0;  ///< largest force on the probe [N]
  std::size_t pieces = 0;
};

Operation operate(const Scene& scene) {
  Simulation simulation(scene);
  Operation run;
  const Quat down = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));  // shaft up, edge to +x
  for (int i = 0; i < 24; ++i) {
    const double t = i / 24.0;
    simulation.set_tool(0, {Vec3(0.002 + 0.01 * t, 0.05 - 0.13 * t, -0.001), down});
    simulation.set_tool(1, {Vec3(0.03, -0.01, 0.036 - 0.012 * t), down});
    if (i == 12) {
      BladePath path;
      path.edge = {Vec3(-0.02, -0.1, 0), Vec3(-0.02, 0.1, 0)};
      path.poses.resize(2);
      path.poses[0].position.z() = -0.01;
      path.poses[1].position.z() = 0.05;
      simulation.cut(path);
    }
    const FrameReport report = simulation.advance_frame();
    run.checksums.push_back(simulation.tissue().checksum());
    run.bonds_broken += report.result.blade_report.bonds_broken;
    run.push = std::max(run.push, report.result.loads[1].peak_force);
  }
  run.pieces = simulation.tissue().fragments().size();
  return run;
}

TEST_P(SameBits, RunAfterRunAndForAnyNumberOfThreads) {
  // Else TBB starts no more threads than there are cores, whatever a scene asks for.
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 4);
  const Operation first = operate(operation(1));
  EXPECT_GT(first.bonds_broken, 10);
  if (GetParam().method != Method::kMls) {  // its nodes are too far apart for the tip
    EXPECT_GT(first.push, 0.002);
  }
  EXPECT_GE(first.pieces, 2u);
  const std::set<std::uint64_t> different(first.checksums.begin(), first.checksums.end());
  EXPECT_EQ(different.size(), first.checksums.size());
  for (const int threads : {1, 2, 3, 0}) {
    const Operation again = operate(operation(threads));
    for (std::size_t i = 0; i < first.checksums.size(); ++i) {
      ASSERT_EQ(again.checksums[i], first.checksums[i]) << threads << " threads, frame " << i;
    }
  }
}

TEST_P(SameBits, TheChecksumSeesTheLastBit) {
  Scene other = operation(1);
  Simulation a(operation(1)), b(other);
  EXPECT_EQ(a.tissue().checksum(), b.tissue().checksum());
  other.gravity.z() = std::nextafter(static_cast<float>(other.gravity.z()), 0.0f);
  Simulation c(other);
  for (Simulation* s : {&a, &b, &c}) s->advance_frame();
  EXPECT_EQ(a.tissue().checksum(), b.tissue().checksum());
  EXPECT_NE(a.tissue().checksum(), c.tissue().checksum());
}

}  // namespace
}  // namespace tissue_sim
