// Speed of the material point method on the CPU. One item is one point advanced by one substep,
// everything included. Each run checks its last substep against the double-precision reference.
#include <benchmark/benchmark.h>
#include <malloc.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "cut_scenes.h"
#include "cutting/tear.h"
#include "machine_rates.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {
namespace {

struct Case {
  int points;
  Law law = Law::kFixedCorotated;
  bool ground = false;
  std::vector<Vec3> cuts = {};  ///< normals of planes through the middle
  double viscosity = 0;
  int threads = 0;
  bool tears = false;  ///< looks for tears as often as a frame would, and finds none
  int anchors = 0;     ///< regions that hold it
  int materials = 1;   ///< spread through it in balls
  bool both_laws = false;
  bool ring = false;  ///< a slanting ring that fills a tenth of its box, not a cube
};

/// Fills the body with balls, four or five along each edge, of `count` materials in turn.
void add_materials(const Case& c, double edge, Scene& scene) {
  const int along = 2 * static_cast<int>(std::cbrt(c.materials)) + 1;
  for (int i = 1; i < c.materials; ++i) {
    Material m = scene.materials[0];
    m.name += std::to_string(i);
    m.young_modulus *= 1 + 0.1 * i;
    m.density *= 1 + 0.02 * i;
    if (c.both_laws && i % 2 == 1) m.law = Law::kNeoHookean;
    scene.materials.push_back(m);
  }
  for (int i = 0; i < along * along * along; ++i) {
    Inclusion ball;
    ball.material = scene.materials[i % c.materials].name;
    ball.region.kind = Region::Kind::kBall;
    ball.region.center =
        edge / along * Vec3(i % along + 0.5, i / along % along + 0.5, i / along / along + 0.5);
    ball.region.radius = 0.55 * edge / along;
    scene.bodies[0].inclusions.push_back(ball);
  }
}

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

/// Writes a ring of radius 1 and thickness 0.24 around the z axis; returns its path.
std::string ring_mesh() {
  const std::string path = "/tmp/tissue_sim_benchmark_" + std::to_string(getpid()) + ".obj";
  std::ofstream file(path);
  constexpr int kAround = 96, kAcross = 32;
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const double a = 2 * M_PI * i / kAround, b = 2 * M_PI * j / kAcross;
      const double r = 1 + 0.24 * std::cos(b);
      file << "v " << r * std::cos(a) << " " << r * std::sin(a) << " " << 0.24 * std::sin(b)
           << "\n";
    }
  }
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const int k = (i + 1) % kAround, l = (j + 1) % kAcross;
      file << "f " << i * kAcross + j + 1 << " " << k * kAcross + j + 1 << " "
           << k * kAcross + l + 1 << "\nf " << i * kAcross + j + 1 << " " << k * kAcross + l + 1
           << " " << i * kAcross + l + 1 << "\n";
    }
  }
  return path;
}

/// A body of about so many points, eight a cell, sheared, twisted and shaken.
std::unique_ptr<MpmTissue> deformed_body(const Case& c) {
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
  Body& body = scene.bodies[0];
  body.material = "cube";
  for (int i = 0; i < c.anchors; ++i) {
    Region held;
    held.kind = Region::Kind::kBall;
    held.center = edge * Vec3(i % 10 / 9.0, i / 10 / 9.0, 0);
    held.radius = 1.5 * h;
    body.anchors.push_back(held);
  }
  if (c.materials > 1) add_materials(c, edge, scene);
  if (c.ring) {
    body.shape = Shape::kMesh;
    body.mesh = ring_mesh();
    body.scale = edge / std::cbrt(2 * M_PI * M_PI * 0.24 * 0.24);  // of the same volume
    body.pose.orientation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 1, 0).normalized()));
  }
  auto tissue = std::make_unique<MpmTissue>(scene);
  deform(tissue->state());
  if (c.ring) std::remove(body.mesh.c_str());
  for (const Vec3& normal : c.cuts) {
    // Off the cells' faces, so that there are cells on both sides.
    cut_now(*tissue, plane_cut(Vec3::Constant(0.5 * edge + 0.02 * h), normal));
  }
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
  if (!c.ground) {
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

void add(const std::string& name, const Case& c) {
  benchmark::RegisterBenchmark(("mpm/cpu/" + name).c_str(), [c](benchmark::State& s) { run(s, c); })
      ->Unit(benchmark::kMicrosecond)
      ->UseRealTime()
      ->MinTime(0.3);
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
    add("/on_ground", [](Case& c) { c.ground = true; });
    add("/cut_along_axis", [](Case& c) { c.cuts = {{1, 0, 0}}; });
    add("/cut", [](Case& c) { c.cuts = {{1, 0.6, 0.3}}; });
    add("/cut_twice", [](Case& c) { c.cuts = {{1, 0.3, 0.2}, {-0.3, 1, 0.1}}; });
    add("/anchors:100", [](Case& c) { c.anchors = 100; });
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
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
