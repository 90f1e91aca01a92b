// Speed of the material point method on the CPU: a cube, to compare with others, whose last substep
// is checked against the double-precision reference; organs as users run them (organ_benchmark.h).
// One item is one point advanced by one substep, everything included.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "camera_benchmark.h"
#include "fluid_benchmark.h"
#include "machine_rates.h"
#include "mls_benchmark.h"
#include "organ_benchmark.h"
#include "pbd_benchmark.h"
#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

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

/// What the machine can do, on all threads.
struct MachineRates {
  double triad, fused;
};
const MachineRates& machine_rates(InstructionSet set) {
  static const MachineRates rates = [set] {
    Cpu cpu(0);
    return MachineRates{triad_rate(cpu), fused_rate(cpu, set)};
  }();
  return rates;
}

/// Operations (fused where they can be) and bytes of node memory that one update of a point takes:
/// docs/benchmarks.md counts them.
constexpr double kOperations = 90 + 160, kBytes = 13;

/// A free cube of about so many points, eight a cell, sheared, twisted and shaken.
void run_cube(benchmark::State& bench, int points) {
  const double heap = heap_bytes();
  const double h = 0.003;
  Scene scene = inviscid(free_box(Vec3::Constant(std::round(std::cbrt(points / 8.0)) * h), h));
  MpmTissue tissue(scene);
  MpmState& s = tissue.state();
  deform(s);
  shake(s, 1, 0.01 * h);
  // Far below the stable substep, so that the body stays deformed however long the run is.
  const float dt = 1e-3f * tissue.stable_substep();
  advance_by(tissue, 1, dt, {});
  std::vector<ColliderLoad> loads(s.colliders.size());
  const double bytes = heap_bytes() - heap;
  const MachineRates& rates = machine_rates(s.instructions);
  const float real_dt = tissue.stable_substep();  // contact is looked for as often as it says
  for (auto _ : bench) {
    find_face_contacts(s, tissue.pieces(), real_dt);
    substep(s, dt, loads);
  }
  s.faces.forget_active();  // the reference knows no contact
  const std::string wrong = difference(s, dt);
  if (!wrong.empty()) bench.SkipWithError(wrong.c_str());
  bench.SetItemsProcessed(bench.iterations() * s.points.size());
  bench.counters["points"] = s.points.size();
  // Shares of the machine's limits: the larger one is what the row is bound by.
  const double updates = static_cast<double>(bench.iterations()) * s.points.size();
  bench.counters["of_fused_rate"] =
      benchmark::Counter(updates * kOperations / rates.fused, benchmark::Counter::kIsRate);
  bench.counters["of_triad_rate"] =
      benchmark::Counter(updates * kBytes / rates.triad, benchmark::Counter::kIsRate);
  bench.counters["triad_bytes_per_s"] = rates.triad;
  bench.counters["fused_per_s"] = rates.fused;
  bench.counters["bytes_per_point"] = bytes / s.points.size();
  bench.SetLabel(tissue.device_name());
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using namespace tissue_sim;
  for (const int points : {25000, 100000}) {
    benchmark::RegisterBenchmark(("mpm/cpu/cube/" + std::to_string(points)).c_str(), run_cube,
                                 points)
        ->Unit(benchmark::kMicrosecond)
        ->UseRealTime()
        ->MinTime(0.3);
  }
  add_organ_benchmarks(Device::kCpu, [](const Tissue& tissue) { return tissue.device_name(); });
  add_camera_benchmarks(Device::kCpu);
  add_mls_rows();
  add_pbd_rows();
  add_fluid_rows();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
