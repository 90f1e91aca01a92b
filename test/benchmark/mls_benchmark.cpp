// Speed of the meshless method on the CPU. One item is one node advanced by one substep, everything
// included: fixed corotated stress, penalty, contact with the ground and a probe that is far away.
// Each run checks forces against the double-precision reference on the deformed body.
#include "benchmark/mls_benchmark.h"

#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <string>
#include <vector>

#include "mls/cut.h"
#include "mls/mls_scenes.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

struct MlsCase {
  int nodes;
  int threads = 0;
  int neighbours = 18;
  double viscosity = 0;
  bool cut = false;
  bool scalpel = false;  ///< a sweep is timed, and nothing else
};

constexpr double kSpacing = 0.0015;

std::unique_ptr<MlsTissue> deformed_nodes(const MlsCase& c) {
  const double edge = std::round(std::cbrt(c.nodes)) * kSpacing;
  Scene scene = mls_box(Vec3::Constant(edge), kSpacing);
  scene.threads = c.threads;
  scene.mls.neighbours = c.neighbours;
  scene.ground.enabled = true;
  scene.ground.z = -0.1;
  scene.tools.resize(1);
  Material m;
  m.name = scene.bodies[0].material = "cube";
  m.viscosity = c.viscosity;
  scene.materials.push_back(m);
  auto tissue = std::make_unique<MlsTissue>(scene);
  MlsState& s = tissue->state();
  if (c.cut) tissue->cut_now(plane_cut(Vec3::Constant(0.501 * edge), Vec3(1, 0.6, 0.3)));
  for (int i = 0; i < s.count(); ++i) {
    const Vec3 x = s.nodes.place[i];
    const Vec3 u(0.2 * x.y() + 0.002 * std::sin(60 * x.x()), 0.15 * x.x() - 0.2 * x.y(),
                 0.2 * x.z() + 0.1 * x.x());
    for (int a = 0; a < 3; ++a) s.u[4 * i + a] = static_cast<float>(u[a]);
  }
  return tissue;
}

void run(benchmark::State& bench, const MlsCase& c) {
  const auto tissue = deformed_nodes(c);
  MlsState& s = tissue->state();
  ToolMotion probe;
  probe.present = true;
  probe.begin.position = probe.end.position = Vec3(0, 0, 1);
  const FrameColliders colliders(s.scene, {{&probe, 1}, {}}, 1 / s.scene.frame_rate);
  colliders.at(0, s.colliders);
  std::vector<ColliderLoad> loads(s.colliders.size());
  const float dt = 1e-8f;  // so that the body stays deformed however long the run is
  for (auto _ : bench) substep(s, dt, loads);
  Array<float> force(s.u.size());
  internal_forces(s, s.u.data(), force.data());
  const std::vector<Vec3> expected = reference::mls_forces(s);
  double most = 0, off = 0, strain = 0;
  for (int i = 0; i < s.count(); ++i) {
    most = std::max(most, expected[i].norm());
    off = std::max(off,
                   (Vec3(force[4 * i], force[4 * i + 1], force[4 * i + 2]) - expected[i]).norm());
  }
  for (const auto& H : reference::mls_gradients(s)) strain = std::max(strain, H.norm());
  if (strain < 0.1) bench.SkipWithError("the body is not deformed");
  if (!(off < 1e-4 * most)) bench.SkipWithError("forces are not those of the reference");
  bench.SetItemsProcessed(bench.iterations() * s.count());
  bench.counters["nodes"] = s.count();
  bench.counters["neighbours"] = static_cast<double>(s.pairs.other.size()) / s.count();
  bench.SetLabel(tissue->device_name());
}

/// The sweep of a scalpel through the whole body, with what follows: pieces, moments, springs.
void run_scalpel(benchmark::State& bench, const MlsCase& c) {
  double shortest = 1e30;
  const auto tissue = deformed_nodes(c);
  const std::vector<std::uint8_t> whole = tissue->save();
  for (auto _ : bench) {
    tissue->restore({whole.data(), whole.size()});
    const double middle = 0.501 * std::round(std::cbrt(c.nodes)) * kSpacing;
    const auto begin = std::chrono::steady_clock::now();
    const CutReport report = tissue->cut_now(plane_cut(Vec3::Constant(middle), Vec3(1, 0.6, 0.3)));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    bench.SetIterationTime(took.count());
    shortest = std::min(shortest, took.count());
    if (report.bonds_broken == 0) bench.SkipWithError("no cut");
    bench.counters["pairs"] = static_cast<double>(report.bonds_broken);
  }
  bench.counters["shortest_ms"] = 1e3 * shortest;
}

/// A simulated second of a soft cube that stands on the ground, whole or cut in two as it begins:
/// what a cut costs, with the substeps and the contact that it brings.
void run_second(benchmark::State& bench, bool is_cut) {
  constexpr double kApart = 0.002;
  const double edge = 22 * kApart;
  Scene scene = mls_box(Vec3::Constant(edge), kApart);
  scene.threads = 1;
  scene.gravity = Scene().gravity;
  scene.ground.enabled = true;
  Material m;
  m.name = scene.bodies[0].material = "cube";
  m.young_modulus = 10000;
  scene.materials.push_back(m);
  long substeps = 0;
  for (auto _ : bench) {
    MlsTissue tissue(scene);
    if (is_cut) tissue.cut_now(plane_cut(Vec3::Constant(0.501 * edge), Vec3(1, 0.6, 0.3)));
    const std::clock_t begin = std::clock();
    for (int frame = 0; frame < 60; ++frame) {
      tissue.advance(1 / scene.frame_rate, {});
      const FrameResult result = tissue.finish();
      substeps += result.substeps;
      if (result.blew_up) bench.SkipWithError("it blew up");
    }
    bench.SetIterationTime(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  bench.counters["substeps"] = static_cast<double>(substeps) / bench.iterations();
}

void add(const std::string& name, const MlsCase& c) {
  benchmark::internal::Benchmark* row = benchmark::RegisterBenchmark(
      ("mls/cpu/" + name).c_str(),
      [c](benchmark::State& s) { c.scalpel ? run_scalpel(s, c) : run(s, c); });
  if (c.scalpel) {
    row->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(50);
  } else {
    row->Unit(benchmark::kMicrosecond)->UseRealTime()->MinTime(0.3);
  }
}

}  // namespace

void add_mls_rows() {
  for (const int nodes : {10000, 50000}) {
    const std::string n = std::to_string(nodes);
    add(n, {nodes});
    MlsCase c{nodes};
    c.threads = 1;
    add(n + "/threads:1", c);
    c.threads = 2;
    add(n + "/threads:2", c);
    c = {nodes};
    c.neighbours = 32;
    add(n + "/neighbours:32", c);
    c = {nodes};
    c.viscosity = 1;
    add(n + "/viscous", c);
    c = {nodes};
    c.cut = true;
    add(n + "/cut", c);
    c = {nodes};
    c.scalpel = true;
    add(n + "/scalpel", c);
    c.threads = 2;
    add(n + "/scalpel/threads:2", c);
  }
  for (const bool is_cut : {false, true}) {
    const std::string name = is_cut ? "mls/cpu/second/cut" : "mls/cpu/second";
    benchmark::RegisterBenchmark(name.c_str(),
                                 [is_cut](benchmark::State& s) { run_second(s, is_cut); })
        ->Unit(benchmark::kMillisecond)
        ->UseManualTime()
        ->Iterations(1);
  }
}

}  // namespace tissue_sim
