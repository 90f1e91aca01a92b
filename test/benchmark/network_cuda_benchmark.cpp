// Frames a second of tissue that is torn on a GPU, with the fragment network and without: see
// network_benchmark.cpp.
#include <benchmark/benchmark.h>

#include <string>

#include "benchmark/torn_bar.h"
#include "compute/cuda_check.h"
#include "support/cuda_mpm_tissue.h"

namespace tissue_sim {
namespace {

void run_frames(benchmark::State& bench, int points, bool network) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  run_torn_bar<CudaMpmTissue>(bench, torn_bar(points, 0), network,
                              [](CudaMpmTissue& tissue) { tissue.push(); });
}

const bool added = [] {
  for (const int points : {9000, 25000}) {
    for (const bool network : {false, true}) {
      std::string name = "fragments/cuda/frames/" + std::to_string(points);
      if (network) name += "/network";
      benchmark::RegisterBenchmark(name.c_str(),
                                   [=](benchmark::State& s) { run_frames(s, points, network); })
          ->Unit(benchmark::kMillisecond)
          ->UseManualTime()
          ->MinTime(1);
    }
  }
  return true;
}();

}  // namespace
}  // namespace tissue_sim
