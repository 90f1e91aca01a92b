// Speed of the detection of fragments on the CPU: one item is one execution, from where points are
// to which group each is in. Rows `labelling` leave out what both searches do alike before and
// after: finding the cells of points, and reading out the groups.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <string>

#include "paper/breadth_first.h"
#include "paper/hash_grid.h"
#include "paper/torn_points.h"

namespace tissue_sim {
namespace {

struct DetectionCase {
  int dimensions = 2, points = 25000, cells = 128, threads = 1;
  bool labelling = false;
};

PointGroups by_links(const TornPoints& torn) {
  UnionFind linked(torn.x[0].size());
  for (const auto& link : torn.links) linked.join(link[0], link[1]);
  return groups_of_links(linked);
}

TornPoints points_of(const DetectionCase& c) {
  return torn_points(c.dimensions, c.points, c.dimensions == 2 ? 20 : 25, 2, c.cells);
}

/// Runs a search, all of it or its middle step, and checks what it found.
template <class Search, class Label>
void run(benchmark::State& bench, const DetectionCase& c, Search& search, const Label& label) {
  const TornPoints torn = points_of(c);
  Cpu cpu(c.threads);
  for (auto _ : bench) {
    if (!c.labelling) {
      benchmark::DoNotOptimize(search.find_groups(torn.places(), torn.box, cpu).count.data());
      continue;
    }
    search.mark(torn.places(), torn.box, cpu);
    const auto begin = std::chrono::steady_clock::now();
    label(search, cpu);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    bench.SetIterationTime(took.count());
  }
  const PointGroups expected = by_links(torn);
  if (search.read_out(cpu).of_point != expected.of_point)
    bench.SkipWithError("not the same groups");
  bench.SetItemsProcessed(bench.iterations());
  bench.counters["points"] = static_cast<double>(torn.x[0].size());
  bench.counters["groups"] = static_cast<double>(expected.count.size());
}

void run_hash_grid(benchmark::State& bench, const DetectionCase& c) {
  HashGrid grid;
  run(bench, c, grid, [](HashGrid& g, Cpu& cpu) { g.label(cpu); });
}

void run_breadth_first(benchmark::State& bench, const DetectionCase& c) {
  BreadthFirstSearch search;
  run(bench, c, search, [](BreadthFirstSearch& s, Cpu&) { s.label(); });
}

void run_union_find(benchmark::State& bench, const DetectionCase& c) {
  const TornPoints torn = points_of(c);
  for (auto _ : bench) benchmark::DoNotOptimize(by_links(torn).count.data());
  bench.SetItemsProcessed(bench.iterations());
  bench.counters["points"] = static_cast<double>(torn.x[0].size());
}

void add(const std::string& name, const DetectionCase& c,
         void (*run_case)(benchmark::State&, const DetectionCase&)) {
  std::string full = "fragments/cpu/" + name + "/" + std::to_string(c.dimensions) + "d/" +
                     std::to_string(c.points);
  if (c.labelling) full += "/labelling";
  if (c.threads == 1) full += "/threads:1";
  auto* row =
      benchmark::RegisterBenchmark(full.c_str(), [=](benchmark::State& s) { run_case(s, c); });
  row->Unit(benchmark::kMicrosecond)->MinTime(0.2);
  c.labelling ? row->UseManualTime() : row->UseRealTime();
}

const bool added = [] {
  for (const DetectionCase& size :
       {DetectionCase{2, 25000, 128}, DetectionCase{3, 100000, 0}, DetectionCase{3, 1000000, 0}}) {
    for (const bool labelling : {false, true}) {
      DetectionCase c = size;
      c.labelling = labelling;
      add("breadth_first", c, run_breadth_first);
      add("hash_grid", c, run_hash_grid);
      c.threads = 0;
      add("hash_grid", c, run_hash_grid);
    }
    add("union_find", size, run_union_find);
  }
  return true;
}();

}  // namespace
}  // namespace tissue_sim
