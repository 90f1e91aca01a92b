// Speed of the detection of fragments on the GPU: one item is one execution, from where points are
// on the GPU to which group each is in, there; rows as fragments_benchmark.cpp has them for the
// CPU.
#include <benchmark/benchmark.h>

#include <string>

#include "paper/cuda_hash_grid.h"
#include "paper/hash_grid.h"
#include "paper/torn_points.h"

namespace tissue_sim {
namespace {

void run(benchmark::State& bench, int dimensions, int points, int cells) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  const TornPoints torn = torn_points(dimensions, points, dimensions == 2 ? 20 : 25, 2, cells);
  PointPlaces places = torn.places();
  DeviceArray<float> x[3];
  for (int a = 0; a < dimensions; ++a) {
    x[a].upload(torn.x[a], nullptr);
    places.x[a] = x[a].data();
  }
  CudaHashGrid grid;
  std::int32_t groups = 0;
  for (auto _ : bench) {
    grid.find_groups(places, torn.box, nullptr);
    groups = grid.wait(nullptr);
  }
  Cpu cpu(1);
  HashGrid on_cpu;
  const PointGroups& expected = on_cpu.find_groups(torn.places(), torn.box, cpu);
  PointGroups found;
  found.of_point.resize(places.count);
  grid.of_point().download(found.of_point.data(), found.of_point.size(), nullptr);
  check_cuda(cudaStreamSynchronize(nullptr), "send data");
  if (found.of_point != expected.of_point) bench.SkipWithError("not the groups that the CPU finds");
  bench.SetItemsProcessed(bench.iterations());
  bench.counters["points"] = places.count;
  bench.counters["groups"] = groups;
}

const bool added = [] {
  const auto add = [](int dimensions, int points, int cells) {
    const std::string name =
        "fragments/cuda/hash_grid/" + std::to_string(dimensions) + "d/" + std::to_string(points);
    benchmark::RegisterBenchmark(
        name.c_str(), [=](benchmark::State& bench) { run(bench, dimensions, points, cells); })
        ->Unit(benchmark::kMicrosecond)
        ->UseRealTime();
  };
  add(2, 25000, 128);
  add(3, 100000, 0);
  add(3, 1000000, 0);
  return true;
}();

}  // namespace
}  // namespace tissue_sim
