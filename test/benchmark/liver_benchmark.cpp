#include "benchmark/liver_benchmark.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include "compute/cuda_check.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

/// A block of liver, 100 x 60 x 50 mm, held from below, into which a probe presses or whose
/// upper edge a grasper pulls.
struct Liver {
  const char* name;
  double cell_size, young_modulus, poisson_ratio;  // [m], [Pa]
  double depth;                                    // that the probe goes in [m]
  enum Blade { kNone, kHeld, kCuts } blade;        // held in a cut that was made before
  bool grasped = false;                            // by a grasper instead of the probe
};
constexpr double kSoft = 5e3, kSkin = 1e5, kGentle = 0.003, kDeep = 0.008;
constexpr Liver kLivers[] = {{"probe/3mm", 3e-3, kSoft, 0.45, kGentle, Liver::kNone},
                             {"probe/2mm", 2e-3, kSoft, 0.45, kGentle, Liver::kNone},
                             {"probe/1.5mm", 1.5e-3, kSoft, 0.45, kGentle, Liver::kNone},
                             {"probe/1mm", 1e-3, kSoft, 0.45, kGentle, Liver::kNone},
                             {"probe/0.75mm", 7.5e-4, kSoft, 0.45, kGentle, Liver::kNone},
                             {"probe/1mm/deep", 1e-3, kSoft, 0.45, kDeep, Liver::kNone},
                             {"probe/1mm/nu0.49", 1e-3, kSoft, 0.49, kGentle, Liver::kNone},
                             {"probe/1mm/skin", 1e-3, kSkin, 0.45, kGentle, Liver::kNone},
                             {"3mm", 3e-3, kSoft, 0.45, kGentle, Liver::kHeld},
                             {"2mm", 2e-3, kSoft, 0.45, kGentle, Liver::kHeld},
                             {"1.5mm", 1.5e-3, kSoft, 0.45, kGentle, Liver::kHeld},
                             {"1mm", 1e-3, kSoft, 0.45, kGentle, Liver::kHeld},
                             {"0.75mm", 7.5e-4, kSoft, 0.45, kGentle, Liver::kHeld},
                             {"1mm/nu0.49", 1e-3, kSoft, 0.49, kGentle, Liver::kHeld},
                             {"1mm/skin", 1e-3, kSkin, 0.45, kGentle, Liver::kHeld},
                             {"grasper/3mm", 3e-3, kSoft, 0.45, kGentle, Liver::kHeld, true},
                             {"grasper/2mm", 2e-3, kSoft, 0.45, kGentle, Liver::kHeld, true},
                             {"grasper/1.5mm", 1.5e-3, kSoft, 0.45, kGentle, Liver::kHeld, true},
                             {"grasper/1mm", 1e-3, kSoft, 0.45, kGentle, Liver::kHeld, true},
                             {"grasper/0.75mm", 7.5e-4, kSoft, 0.45, kGentle, Liver::kHeld, true},
                             {"grasper/1mm/nu0.49", 1e-3, kSoft, 0.49, kGentle, Liver::kHeld, true},
                             {"grasper/1mm/skin", 1e-3, kSkin, 0.45, kGentle, Liver::kHeld, true},
                             {"cutting/3mm", 3e-3, kSoft, 0.45, kGentle, Liver::kCuts},
                             {"cutting/1mm", 1e-3, kSoft, 0.45, kGentle, Liver::kCuts}};

Scene liver_scene(const Liver& liver, MpmBoundary boundary) {
  Scene scene;
  scene.mpm.boundary = boundary;
  scene.cell_size = liver.cell_size;
  scene.damping = 2;
  scene.device = Device::kCuda;
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.size = Vec3(0.1, 0.06, 0.05);
  body.pose.position = 0.5 * body.size;
  Region below;
  below.z = 0.002;
  body.anchors = {below};
  scene.materials.resize(1);
  Material& m = scene.materials[0];
  m.name = body.material = "test";
  m.young_modulus = liver.young_modulus;
  m.poisson_ratio = liver.poisson_ratio;
  scene.tools.resize(2);
  scene.tools[0].name = liver.grasped ? "grasper" : "probe";
  scene.tools[0].type = liver.grasped ? ToolType::kGrasper : ToolType::kProbe;
  scene.tools[0].grip_pressure = liver.young_modulus;
  scene.tools[0].cohesion = 2 * liver.young_modulus;
  if (liver.grasped) scene.tools[0].friction = 1;
  scene.tools[1].name = "scalpel";
  scene.tools[1].type = ToolType::kScalpel;
  scene.tools[1].blade_length = 0.03;
  return scene;
}

/// The jaws close about the upper edge at x = 0.1 m within 0.3 s, then pull it to and fro.
void move_grasper(Simulation& simulation, double t) {
  const Vec3 edge(0.1, 0.03, 0.05), inward = Vec3(-1, 0, -1).normalized();
  const double pulled = t > 0.33 ? 0.0015 * (1 - std::cos(5 * (t - 0.33))) : 0;
  Eigen::Matrix3d axes;
  axes.col(1) = Vec3::UnitY();
  axes.col(2) = inward;
  axes.col(0) = axes.col(1).cross(axes.col(2));
  simulation.set_tool(0, {edge + (0.011 - pulled) * inward, Quat(axes)},
                      std::max(0.0, 2.2 - 4 * t));
}

/// How many times faster than real time, clouds of all points at 30 Hz included.
void operate(benchmark::State& bench, const Liver& liver, MpmBoundary boundary) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  Simulation simulation(liver_scene(liver, boundary));
  const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const Quat blade = Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ())) * down;  // cuts towards +y
  std::vector<std::uint8_t> cloud;
  FrameReport report;
  std::int64_t bonds_broken = 0;
  double peak = 0;
  const auto frame = [&] {
    const double t = simulation.time(), press = std::min(1.0, t / 0.2);
    const double along = 0.07 + 0.005 * std::sin(5 * t);
    if (liver.grasped) {
      move_grasper(simulation, t);
    } else {
      simulation.set_tool(0, {Vec3(along, 0.03, 0.051 - (0.001 + liver.depth) * press), down}, 0);
    }
    if (liver.blade != Liver::kNone) {  // 20 mm deep, in its cut, or 30 mm/s through whole tissue
      const double y = liver.blade == Liver::kCuts ? -0.005 + 0.03 * t : 0.02;
      simulation.set_tool(1, {Vec3(0.03, y, 0.03), blade}, 0);
    }
    report = simulation.advance_frame();
    bonds_broken += report.result.blade_report.bonds_broken;
    for (const ToolLoad& load : report.result.loads) peak = std::max(peak, load.peak_force);
    if (simulation.frame() % 2 == 0) simulation.tissue().read_points({}, cloud);
  };
  if (liver.blade == Liver::kHeld) {
    BladePath path;
    path.edge = {Vec3(0, 0, 0), Vec3(0, 0, -0.03)};
    path.poses = {{Vec3(0.03, -0.005, 0.03), blade}, {Vec3(0.03, 0.03, 0.03), blade}};
    simulation.cut(path);
  }
  for (int i = 0; i < 20; ++i) frame();
  bonds_broken = 0;
  std::int64_t substeps = 0;
  const double begin = simulation.time();
  const auto start = std::chrono::steady_clock::now();
  for (auto _ : bench) {
    frame();
    substeps += report.result.substeps;
  }
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - start;
  const double simulated = simulation.time() - begin;
  if (report.result.blew_up) bench.SkipWithError("blew up");
  if (liver.blade == Liver::kCuts && bonds_broken == 0) bench.SkipWithError("no cut");
  if (liver.grasped && report.result.loads[0].grip <= 0) bench.SkipWithError("holds nothing");
  bench.counters["real_time_factor"] = benchmark::Counter(simulated, benchmark::Counter::kIsRate);
  bench.counters["us_per_substep"] = took.count() / substeps;
  bench.counters["substeps"] = static_cast<double>(substeps) / bench.iterations();
  bench.counters["cfl"] = report.cfl;
  bench.counters["peak_force"] = peak;
  bench.counters["grip"] = report.result.loads[0].grip;
  bench.counters["bonds_broken"] = static_cast<double>(bonds_broken);
  bench.counters["points"] = simulation.tissue().point_count();
  const auto* on_gpu = dynamic_cast<const CudaMpmTissue*>(&simulation.tissue());
  if (on_gpu != nullptr) bench.SetLabel(on_gpu->plan());
}

}  // namespace

void add_liver_benchmarks() {
  for (const Liver& liver : kLivers) {
    for (const MpmBoundary boundary : {MpmBoundary::kSurface, MpmBoundary::kLattice}) {
      const std::string name = std::string("mpm/cuda/liver/") + liver.name;
      benchmark::RegisterBenchmark(
          (boundary == MpmBoundary::kLattice ? name + "/lattice" : name).c_str(), operate, liver,
          boundary)
          ->UseRealTime()
          ->Iterations(30)
          ->Unit(benchmark::kMillisecond);
    }
  }
}

}  // namespace tissue_sim
