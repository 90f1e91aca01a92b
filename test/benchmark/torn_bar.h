// A bar that its own motion tears: frames a second with the fragment network and without.
#pragma once

#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <ctime>
#include <string>

#include "support/network_text.h"
#include "support/temporary_folder.h"
#include "tissue_sim/material.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Of some points; free, in no gravity.
inline Scene torn_bar(int points, int threads) {
  Scene scene;
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

/// Twelve frames from when it gets going, as fast as tears it in two, again and again; `push`
/// brings what was done to the tissue's state to where it lives.
template <class AnyTissue, class Push>
void run_torn_bar(benchmark::State& bench, Scene scene, bool network, const Push& push) {
  const TemporaryFolder folder;  // what the weights say takes as long whatever they are
  if (network) scene.fragment_network = folder.write("network.yaml", network_text());
  double candidates = 0, frames = 0, processor = 0;  // [s]: what other programs take is not in it
  for (auto _ : bench) {
    AnyTissue tissue(scene);
    auto& s = tissue.state();
    const double rate = 2 * 0.3 * std::sqrt(5000.0 / 1060) / scene.bodies[0].size.x();
    for (const auto& b : s.bodies) {
      b.for_each_node([&](int node, int i, int j, int k) {
        s.nodes.v[0][node] = static_cast<float>(1.6 * rate * b.node_position(i, j, k).x());
      });
    }
    push(tissue);
    double seconds = 0;
    for (int frame = 0; frame < 12; ++frame) {
      const std::clock_t first = std::clock();
      const auto begin = std::chrono::steady_clock::now();
      tissue.advance(1.0 / 60, {});
      const FrameResult result = tissue.finish();
      seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      processor += static_cast<double>(std::clock() - first) / CLOCKS_PER_SEC;
      candidates += result.fragment_candidates;
      ++frames;
      if (result.blew_up) bench.SkipWithError("it blew up");
    }
    bench.SetIterationTime(seconds);
    bench.counters["pieces"] = tissue.fragment_count();
    bench.counters["points"] = tissue.point_count();
  }
  bench.SetItemsProcessed(static_cast<std::int64_t>(frames));
  bench.counters["processor_ms_a_frame"] = 1000 * processor / frames;
  bench.counters["candidates_a_frame"] = candidates / frames;
}

}  // namespace tissue_sim
