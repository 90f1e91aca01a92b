#include "pbd_benchmark.h"

#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <string>

#include "pbd_bodies.h"

namespace tissue_sim {
namespace {

std::unique_ptr<pbd::State> tetrahedra(int threads, PbdElasticity elasticity) {
  Scene scene = tetrahedra_alone(elasticity, 0.0025);
  scene.threads = threads;
  auto s = pbd::make_state(scene, nullptr);
  disturb(*s);
  return s;
}

void run(benchmark::State& bench, pbd::State& s) {
  const int items = s.links.size() + s.bends.size() + s.strains.size() + s.elastics.size();
  for (auto _ : bench) pbd::project_constraints(s, 1e-3f, false);
  for (int i = 0; i < 3 * s.vertices.size(); ++i) {
    if (!std::isfinite(s.vertices.moved[4 * (i / 3) + i % 3])) return bench.SkipWithError("not finite");
  }
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) * items);
  bench.counters["constraints"] = items;
  bench.counters["vertices"] = s.vertices.size();
}

template <class Make>
void add(const std::string& name, const Make& make) {
  for (const int threads : {1, 2}) {
    benchmark::RegisterBenchmark(
        ("pbd/cpu/" + name + "/threads:" + std::to_string(threads)).c_str(),
        [make, threads](benchmark::State& bench) {
          const auto s = make(threads);
          run(bench, *s);
        })
        ->Unit(benchmark::kMicrosecond)
        ->UseRealTime()
        ->MinTime(0.3);
  }
}

}  // namespace

void add_pbd_rows() {
  add("distance/400000", [](int threads) {
    Scene scene;
    scene.method = Method::kPbd;
    scene.threads = threads;
    auto s = std::make_unique<pbd::State>(scene);
    add_links_of_lattice(*s, 39);
    return s;
  });
  add("strain", [](int threads) { return tetrahedra(threads, PbdElasticity::kStrain); });
  add("elastic", [](int threads) { return tetrahedra(threads, PbdElasticity::kMaterial); });
}

}  // namespace tissue_sim
