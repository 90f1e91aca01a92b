// Frames a second of tissue that is torn, with the fragment network and without: one item is one
// frame. The 2024 paper's figure 3: with it at least 0.9 of the rate without it. And frames of
// training data a second, its table 1: one item is one frame of a coarse run and its truth, with
// features and labels.
#include <benchmark/benchmark.h>

#include <string>

#include "benchmark/torn_bar.h"
#include "mpm/mpm_tissue.h"
#include "programs/dataset/dataset_run.h"

namespace tissue_sim {
namespace {

void run_frames(benchmark::State& bench, int points, int threads, bool network) {
  Scene scene = torn_bar(points, threads);
  scene.device = Device::kCpu;
  run_torn_bar<MpmTissue>(bench, scene, network, [](MpmTissue&) {});
}

/// By bonds, as tissue_sim_dataset does.
void make_training_data(benchmark::State& bench) {
  DatasetOptions options;
  options.frames = 32;
  std::int64_t frames = 0;
  double samples = 0;
  for (auto _ : bench) {
    for (int scene = 0; scene < 4; ++scene) {
      const DatasetSamples of =
          run_dataset_scene(make_dataset_scene(1, scene, {"tension", "cut"}), options);
      samples += static_cast<double>(of.x.size()) / kPartingFeatureCount;
      frames += of.frames;
    }
  }
  bench.SetItemsProcessed(frames);
  bench.counters["samples_a_frame"] = samples / static_cast<double>(frames);
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
  benchmark::RegisterBenchmark("fragments/cpu/training_data/threads:1", make_training_data)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace tissue_sim
