// Frames a second of tissue that is torn, with the fragment network and without: one item is one
// frame. The 2024 paper's figure 3: with it at least 0.9 of the rate without it.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <string>

#include "mpm/mpm_tissue.h"
#include "network_text.h"
#include "temporary_folder.h"

namespace tissue_sim {
namespace {

/// A bar of some points that its own motion tears; frames from then on.
Scene torn_bar(int points, int threads) {
  Scene scene;
  scene.device = Device::kCpu;
  scene.threads = threads;
  scene.cell_size = 0.002;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  Material m;
  m.name = "torn";
  m.viscosity = 0.1;
  m.tear_stretch = 1.3;
  m.tear_length = 0.003;
  scene.materials = {m};
  Body body;
  body.material = m.name;
  const double n = std::round(std::cbrt(points / 16.0));  // cells across, and twice as many along
  body.size = 0.002 * Vec3(2 * n, n, n);
  body.pose.position = Vec3::Zero();
  scene.bodies = {body};
  return scene;
}

void run_frames(benchmark::State& bench, int points, int threads, bool network) {
  Scene scene = torn_bar(points, threads);
  const TemporaryFolder folder;  // what the weights say takes as long whatever they are
  if (network) scene.fragment_network = folder.write("network.yaml", network_text());
  double candidates = 0, frames = 0;
  for (auto _ : bench) {
    MpmTissue tissue(scene);
    MpmState& s = tissue.state();
    const double rate = 2 * 0.3 * std::sqrt(5000.0 / 1060) / scene.bodies[0].size.x();
    for (const LatticeBody& b : s.bodies) {
      b.for_each_node([&](int node, int i, int j, int k) {
        s.nodes.v[0][node] = static_cast<float>(3 * rate * b.node_position(i, j, k).x());
      });
    }
    double seconds = 0;
    for (int frame = 0; frame < 12; ++frame) {
      const auto begin = std::chrono::steady_clock::now();
      tissue.advance(1.0 / 60, {});
      const FrameResult result = tissue.finish();
      seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      candidates += result.fragment_candidates;
      ++frames;
      if (result.blew_up) bench.SkipWithError("it blew up");
    }
    bench.SetIterationTime(seconds);
    bench.counters["pieces"] = tissue.fragment_count();
    bench.counters["points"] = tissue.point_count();
  }
  bench.SetItemsProcessed(static_cast<std::int64_t>(frames));
  bench.counters["candidates_a_frame"] = candidates / frames;
}

const bool added = [] {
  for (const int points : {9000, 25000}) {
    for (const int threads : {1, 0}) {
      for (const bool network : {false, true}) {
        std::string name = "fragments/cpu/frames/" + std::to_string(points);
        if (network) name += "/network";
        if (threads == 1) name += "/threads:1";
        benchmark::RegisterBenchmark(
            name.c_str(), [=](benchmark::State& s) { run_frames(s, points, threads, network); })
            ->Unit(benchmark::kMillisecond)
            ->UseManualTime()
            ->MinTime(1);
      }
    }
  }
  return true;
}();

}  // namespace
}  // namespace tissue_sim
