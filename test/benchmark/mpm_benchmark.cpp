// Speed of the material point method on the CPU. One item is one point advanced by one substep,
// everything included. Each run checks its last substep against the double-precision reference.
// Rows `scalpel` are of a cut while it is made.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "deformed_body.h"
#include "machine_rates.h"
#include "mls_benchmark.h"
#include "mpm/tear/tear.h"
#include "pbd_benchmark.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {
namespace {

/// The heap in use [bytes], out of the XML that the C library writes: mallinfo counts in 32 bits,
/// and mallinfo2 is newer than Ubuntu 20.04.
double heap_bytes() {
  char* text = nullptr;
  size_t length = 0;
  FILE* file = open_memstream(&text, &length);
  malloc_info(0, file);
  std::fclose(file);
  const std::string xml(text, length);
  std::free(text);
  const size_t sums = xml.rfind("</heap>");  // of all arenas, after the last of them
  auto size_of = [&](const char* element) {
    return std::strtod(&xml[xml.find("size=\"", xml.find(element, sums)) + 6], nullptr);
  };
  return size_of("<system type=\"current\"") + size_of("<total type=\"mmap\"") -
         size_of("<total type=\"fast\"") - size_of("<total type=\"rest\"");
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

/// What the machine can do, on as many threads.
struct MachineRates {
  double triad, fused;
};
const MachineRates& machine_rates(int threads, InstructionSet set) {
  static std::map<int, MachineRates> known;
  auto& rates = known[threads];
  if (rates.triad == 0) {
    Cpu cpu(threads);
    rates = {triad_rate(cpu), fused_rate(cpu, set)};
  }
  return rates;
}

/// Operations (fused where they can be) and bytes of node memory that one update of a point takes:
/// docs/benchmarks.md counts them.
double operations(const Case& c) {
  return 90 + (c.law == Law::kNeoHookean ? 45 : 160) + (c.viscosity > 0 ? 25 : 0);
}
constexpr double kBytes = 13;

void run(benchmark::State& bench, const Case& c) {
  const double heap = heap_bytes();
  const auto tissue = deformed_body(c);
  MpmState& s = tissue->state();
  // Far below the stable substep, so that the body stays deformed however long the run is.
  const float dt = 1e-3f * tissue->stable_substep();
  tissue->advance(1, dt, {});  // finds what is near the ground
  std::vector<ColliderLoad> loads(s.colliders.size());
  const double bytes = heap_bytes() - heap;
  const MachineRates& rates = machine_rates(c.threads, s.instructions);
  const float real_dt = tissue->stable_substep();  // what is looked for now and then counts by it
  const int every = 1000 / std::max(1, c.tears ? tear_checks(s, 1000, real_dt) : 1);
  int i = 0;
  for (auto _ : bench) {
    find_face_contacts(s, tissue->pieces(), real_dt);
    substep(s, dt, loads);
    if (c.tears && ++i % every == 0) benchmark::DoNotOptimize(find_tearing(s));
  }
  s.faces.forget_active();  // the reference knows no contact
  // Nor faces of anchors.
  if (!c.ground && (c.anchors == 0 || c.boundary == MpmBoundary::kLattice)) {
    const std::string wrong = difference(s, dt);
    if (!wrong.empty()) bench.SkipWithError(wrong.c_str());
  }
  bench.SetItemsProcessed(bench.iterations() * s.points.size());
  bench.counters["points"] = s.points.size();
  // Shares of the machine's limits: the larger one is what the row is bound by.
  const double updates = static_cast<double>(bench.iterations()) * s.points.size();
  bench.counters["of_fused_rate"] =
      benchmark::Counter(updates * operations(c) / rates.fused, benchmark::Counter::kIsRate);
  bench.counters["of_triad_rate"] =
      benchmark::Counter(updates * kBytes / rates.triad, benchmark::Counter::kIsRate);
  bench.counters["triad_bytes_per_s"] = rates.triad;
  bench.counters["fused_per_s"] = rates.fused;
  bench.counters["bytes_per_point"] = bytes / s.points.size();
  bench.SetLabel(tissue->device_name());
}

/// A scalpel goes through a whole body in one frame: what that takes before the frame's substeps,
/// the shortest and the mean of bodies made anew.
void run_scalpel(benchmark::State& bench, const Case& c) {
  const double h = 0.003;
  const Vec3 place = Vec3::Constant((0.5 * std::round(std::cbrt(c.points / 8.0)) + 0.02) * h);
  const Quat turn = Quat::FromTwoVectors(Vec3::UnitY(), Vec3(1, 0.6, 0.3).normalized());
  ToolMotion sweep;
  sweep.present = true;
  sweep.begin = {place + turn * Vec3(-0.2, 0, 0.1), turn};
  sweep.end = {place + turn * Vec3(0.2, 0, 0.1), turn};
  const ToolMotion away;
  double shortest = 1e30;
  for (auto _ : bench) {
    const auto tissue = deformed_body(c);
    tissue->advance(0, 1e-4f, {{&away, 1}, {}});
    const auto begin = std::chrono::steady_clock::now();
    tissue->advance(0, 1e-4f, {{&sweep, 1}, {}});
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    bench.SetIterationTime(took.count());
    shortest = std::min(shortest, took.count());
    const int bonds = tissue->finish().blade_report.bonds_broken;
    if (bonds == 0) bench.SkipWithError("no cut");
    bench.counters["bonds"] = bonds;
  }
  bench.counters["shortest_ms"] = 1e3 * shortest;
}

void add(const std::string& name, const Case& c) {
  benchmark::internal::Benchmark* row = benchmark::RegisterBenchmark(
      ("mpm/cpu/" + name).c_str(),
      [c](benchmark::State& s) { c.scalpel ? run_scalpel(s, c) : run(s, c); });
  if (c.scalpel) {
    row->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(30);
  } else {
    row->Unit(benchmark::kMicrosecond)->UseRealTime()->MinTime(0.3);
  }
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using tissue_sim::Law;
  for (const int points : {25000, 100000, 500000}) {
    const std::string n = std::to_string(points);
    const auto add = [&](const std::string& name, const auto& set) {
      tissue_sim::Case c{points};
      set(c);
      tissue_sim::add(n + name, c);
    };
    using Case = tissue_sim::Case;
    add("", [](Case&) {});
    add("/threads:1", [](Case& c) { c.threads = 1; });
    add("/neo_hookean", [](Case& c) { c.law = Law::kNeoHookean; });
    add("/may_tear", [](Case& c) { c.tears = true; });
    add("/viscous", [](Case& c) { c.viscosity = 1; });
    // Rows at the true surface say so, all others have the lattice's boundary.
    const auto at_surface = [](Case& c) { c.boundary = tissue_sim::MpmBoundary::kSurface; };
    add("/on_ground", [](Case& c) { c.ground = true; });
    add("/on_ground/surface", [&](Case& c) {
      c.ground = true;
      at_surface(c);
    });
    add("/cut_along_axis", [](Case& c) { c.cuts = {{1, 0, 0}}; });
    add("/cut", [](Case& c) { c.cuts = {{1, 0.6, 0.3}}; });
    add("/cut_twice", [](Case& c) { c.cuts = {{1, 0.3, 0.2}, {-0.3, 1, 0.1}}; });
    add("/anchors:100", [](Case& c) { c.anchors = 100; });
    add("/anchors:100/surface", [&](Case& c) {
      c.anchors = 100;
      at_surface(c);
    });
    add("/materials:10", [](Case& c) { c.materials = 10; });
    add("/materials:10/both_laws", [](Case& c) {
      c.materials = 10;
      c.both_laws = true;
    });
    add("/materials:10/viscous", [](Case& c) {
      c.materials = 10;
      c.viscosity = 1;
    });
    add("/ring", [](Case& c) { c.ring = true; });
    add("/everything", [](Case& c) {
      c.viscosity = 1;
      c.ground = true;
      c.anchors = 100;
      c.cuts = {{1, 0.6, 0.3}};
    });
    add("/everything/surface", [&](Case& c) {
      c.viscosity = 1;
      c.ground = true;
      c.anchors = 100;
      c.cuts = {{1, 0.6, 0.3}};
      at_surface(c);
    });
    add("/scalpel", [](Case& c) { c.scalpel = true; });
    add("/scalpel/surface", [&](Case& c) {
      c.scalpel = true;
      at_surface(c);
    });
    add("/scalpel/threads:1", [](Case& c) {
      c.scalpel = true;
      c.threads = 1;
    });
  }
  tissue_sim::add_mls_rows();
  tissue_sim::add_pbd_rows();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
