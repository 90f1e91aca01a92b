// Speed of the material point method on the CPU. One item is one point advanced by one substep,
// everything included. Each run checks its last substep against the double-precision reference.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>

#include "cut_scenes.h"
#include "cutting/tear.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {
namespace {

struct Case {
  int points;
  Law law = Law::kFixedCorotated;
  bool ground = false;
  bool cut = false;
  double viscosity = 0;
  int threads = 0;
  bool tears = false;  ///< looks for tears as often as a frame would, and finds none
};

/// A cube of about so many points, eight a cell, sheared, twisted and shaken.
std::unique_ptr<MpmTissue> deformed_cube(const Case& c) {
  const double h = 0.003;
  const double edge = std::round(std::cbrt(c.points / 8.0)) * h;
  Scene scene = free_box(Vec3::Constant(edge), h);
  scene.threads = c.threads;
  scene.ground.enabled = c.ground;
  Material m;
  m.name = "cube";
  m.law = c.law;
  m.viscosity = c.viscosity;
  m.tear_stretch = c.tears ? 50 : 0;
  scene.materials.push_back(m);
  scene.bodies[0].material = "cube";
  auto tissue = std::make_unique<MpmTissue>(scene);
  deform(tissue->state());
  if (c.cut) cut_now(*tissue, plane_cut(Vec3::Constant(0.5 * edge), Vec3(1, 0.3, 0.2)));
  shake(tissue->state(), 1, 0.01 * h);
  return tissue;
}

/// Why the state's next substep is not what the reference says; empty if it is.
std::string difference(MpmState& s, float dt) {
  const reference::Step expected = reference::substep(s, dt);
  if (expected.largest_strain < 0.1) return "the body is not deformed";
  std::vector<ColliderLoad> loads(s.colliders.size());
  substep(s, dt, loads);
  double force = 0;
  for (const Vec3& f : expected.force) force = std::max(force, f.norm());
  for (std::size_t i = 0; i < expected.v.size(); ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;
    const Vec3 v(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    const double bound = 3e-6 * force * dt / expected.mass[i] + 1e-6 * expected.v[i].norm();
    if (!((v - expected.v[i]).norm() <= bound)) return "node " + std::to_string(i) + " is off";
  }
  return "";
}

void run(benchmark::State& bench, const Case& c) {
  const auto tissue = deformed_cube(c);
  MpmState& s = tissue->state();
  // Far below the stable substep, so that the body stays deformed however long the run is.
  const float dt = 1e-3f * tissue->stable_substep();
  tissue->advance(1, dt, {});  // finds what is near the ground
  std::vector<ColliderLoad> loads(s.colliders.size());
  const int every =
      1000 / std::max(1, c.tears ? tear_checks(s, 1000, tissue->stable_substep()) : 1);
  int i = 0;
  for (auto _ : bench) {
    substep(s, dt, loads);
    if (c.tears && ++i % every == 0) benchmark::DoNotOptimize(find_tearing(s));
  }
  if (!c.ground) {
    const std::string wrong = difference(s, dt);
    if (!wrong.empty()) bench.SkipWithError(wrong.c_str());
  }
  bench.SetItemsProcessed(bench.iterations() * s.points.size());
  bench.counters["points"] = s.points.size();
  bench.SetLabel(tissue->device_name());
}

void add(const std::string& name, const Case& c) {
  benchmark::RegisterBenchmark(("mpm/cpu/" + name).c_str(), [c](benchmark::State& s) { run(s, c); })
      ->Unit(benchmark::kMicrosecond)
      ->UseRealTime()
      ->MinTime(0.5);
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using tissue_sim::Law;
  for (const int points : {25000, 100000, 500000}) {
    const std::string n = std::to_string(points);
    tissue_sim::add(n, {points});
    tissue_sim::add(n + "/threads:1", {points, Law::kFixedCorotated, false, false, 0, 1});
    tissue_sim::add(n + "/neo_hookean", {points, Law::kNeoHookean});
    tissue_sim::add(n + "/viscous", {points, Law::kFixedCorotated, false, false, 1.0});
    tissue_sim::add(n + "/may_tear", {points, Law::kFixedCorotated, false, false, 0, 0, true});
    tissue_sim::add(n + "/on_ground", {points, Law::kFixedCorotated, true});
    tissue_sim::add(n + "/cut", {points, Law::kFixedCorotated, false, true});
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
