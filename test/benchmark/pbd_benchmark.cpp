#include "pbd_benchmark.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "geometry/tet_mesh.h"
#include "pbd/model.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

using pbd::State;

std::unique_ptr<State> empty_state(int threads) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.threads = threads;
  return std::make_unique<State>(scene);
}

/// Vertices as a file might have them, in no order, brought into that of the package.
std::vector<int> add_shuffled(State& s, const std::vector<Vec3>& places) {
  std::vector<int> shuffled(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) shuffled[i] = static_cast<int>(i);
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(1));
  std::vector<Vec3> file;
  for (const int i : shuffled) file.push_back(places[i]);
  std::vector<int> index(places.size());
  for (const int k : pbd::morton_order(file)) {
    index[shuffled[k]] = pbd::add_vertex(s, file[k], 0);
    s.vertices.mass.back() = 1e-6;
  }
  return index;
}

/// Moves all vertices aside a little: no constraint is met.
void disturb(State& s) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> aside(-2e-4f, 2e-4f);
  for (int i = 0; i < s.vertices.size(); ++i) {
    for (int a = 0; a < 3; ++a) s.vertices.x[4 * i + a] += aside(random);
  }
}

/// A lattice of some n^3 vertices, each joined to seven others, about 7 n^3 links.
std::unique_ptr<State> links_of_lattice(int n, int threads) {
  auto s = empty_state(threads);
  std::vector<Vec3> places;
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) places.push_back(0.001 * Vec3(i, j, k));
    }
  }
  const std::vector<int> index = add_shuffled(*s, places);
  const auto at = [&](int i, int j, int k) { return index[(k * n + j) * n + i]; };
  constexpr int kTo[7][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0},
                             {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        for (const auto& d : kTo) {
          if (i + d[0] >= n || j + d[1] >= n || k + d[2] >= n) continue;
          const int a = at(i, j, k), b = at(i + d[0], j + d[1], k + d[2]);
          pairs.push_back({std::min(a, b), std::max(a, b)});
        }
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  for (const auto& p : pairs) {
    const double length = (s->vertices.reference[p[0]] - s->vertices.reference[p[1]]).norm();
    s->links.add(p, {static_cast<float>(length), 0.01f});
  }
  pbd::pack(*s);
  disturb(*s);
  return s;
}

std::unique_ptr<State> tetrahedra(int threads, PbdElasticity elasticity, double edge) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.threads = threads;
  scene.cell_size = edge;
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.pbd.elasticity = elasticity;
  scene.pbd.edge = scene.pbd.bending = 0;  // tetrahedra alone
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.05, 0.05, 0.05);
  auto s = pbd::make_state(scene, nullptr);
  disturb(*s);
  return s;
}

void run(benchmark::State& bench, State& s) {
  const int items = s.links.size() + s.bends.size() + s.strains.size() + s.elastics.size();
  for (auto _ : bench) pbd::project_constraints(s, 1e-3f, false);
  for (int i = 0; i < 3 * s.vertices.size(); ++i) {
    if (!std::isfinite(s.vertices.x[4 * (i / 3) + i % 3])) return bench.SkipWithError("not finite");
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
  add("distance/400000", [](int threads) { return links_of_lattice(39, threads); });
  add("strain", [](int threads) { return tetrahedra(threads, PbdElasticity::kStrain, 0.0025); });
  add("elastic", [](int threads) { return tetrahedra(threads, PbdElasticity::kMaterial, 0.0025); });
}

}  // namespace tissue_sim
