// Particle updates a second of the material point method on the GPU (DESIGN section 7): a cube or
// an ellipsoid of tissue between two anchored faces that are held apart and sheared, so that it
// stays deformed when drag has brought it to rest.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>

#include "benchmark/cuda_bodies.h"
#include "benchmark/liver_benchmark.h"
#include "benchmark/mls_benchmark.h"
#include "benchmark/pbd_benchmark.h"
#include "compute/cuda_check.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {
namespace {

enum class Extra {
  kNone,
  kOrgan,
  kCutOrgan,
  kCut,
  kContact,
  kTools,
  kAll,
  kRinging,
  kRingingContact,
  kAnchors,
  kBalls,
  kPartialCut,
  kFront
};

constexpr CubeSize kSizes[] = {{25000, 15, 15, 14},   {100000, 23, 23, 24},
                               {262000, 32, 32, 32},  {1000000, 50, 50, 50},
                               {4100000, 80, 80, 80}, {16800000, 128, 128, 128}};

void run(benchmark::State& bench, const CubeSize& size, Law law, Extra extra) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  Scene scene = cube(size, law);
  if (extra == Extra::kOrgan || extra == Extra::kCutOrgan) make_organ(scene);
  const bool held = extra == Extra::kAnchors || extra == Extra::kBalls;
  if (held) hold_at_faces(scene);
  if (extra == Extra::kBalls) hold_at_balls(scene);
  std::vector<ToolMotion> tools;
  if (extra == Extra::kTools || extra == Extra::kAll) add_probes(scene, tools);
  if (extra == Extra::kAll) add_options(scene, tools);
  const bool rings = extra == Extra::kRinging || extra == Extra::kRingingContact;
  scene.damping = rings ? 0 : 50;
  CudaMpmTissue tissue(scene);
  // Pressed flat, the two halves bulge against one another. With probes it is sheared alone, for
  // its faces to stay where the tips are.
  const bool in_contact =
      extra == Extra::kContact || extra == Extra::kRingingContact || extra == Extra::kAll;
  const double stretch = in_contact ? -0.15 : tools.empty() ? 0.15 : 0;
  deform(tissue.state(), stretch);
  std::vector<AnchorMotion> anchors;
  if (held) anchors = stay_deformed(tissue.state(), stretch);
  tissue.push();
  const float dt = 0.5f * tissue.stable_substep();
  std::vector<BladePath> cuts;
  const bool ends_inside = extra == Extra::kPartialCut || extra == Extra::kFront;
  const bool is_cut =
      in_contact || ends_inside || extra == Extra::kCut || extra == Extra::kCutOrgan;
  tissue.state().front.follows = extra == Extra::kFront;
  if (is_cut) {
    BladePath path;
    path.edge = {Vec3(0, 0, -1), Vec3(0, 0, 1)};
    const Vec3 middle = scene.bodies[0].pose.position;
    path.poses = {{Vec3(-0.5, middle[1] - 0.02, 0), Quat::Identity()},
                  {Vec3(0.5, middle[1] + 0.02, 0), Quat::Identity()}};
    if (ends_inside) {  // amid a cell in the middle of the body, along its front
      path.poses[0].position[1] = path.poses[1].position[1] = middle[1];
      path.poses[1].position[0] = middle[0] + 0.0004;
    }
    cuts.push_back(path);
  }
  tissue.advance(0, dt, {tools, cuts});
  const FrameResult cut = tissue.finish();
  if (is_cut && cut.cut_reports[0].bonds_broken == 0) bench.SkipWithError("no cut");
  if (size.points <= 1000000) {  // against the CPU, ten substeps on
    MpmTissue cpu(scene);
    cpu.state().front.follows = extra == Extra::kFront;
    deform(cpu.state(), stretch);
    if (held) stay_deformed(cpu.state(), stretch);
    measure_motion(cpu.state());
    cpu.advance(0, dt, {tools, cuts});
    cpu.advance(10, dt, {tools, {}, anchors});
    cpu.finish();
    tissue.advance(10, dt, {tools, {}, anchors});
    tissue.finish();
    tissue.pull();
    const Difference off = difference(cpu.state(), tissue.state());
    bench.counters["v_error"] = off.of_all / off.moved;
    bench.counters["v_error_heavy"] = off.of_heavy / off.moved;
    // Faces of a fresh cut are zero deep in one another: whether one touches is a matter of
    // rounding, and light nodes show it.
    const double bound = in_contact ? 2e-2 : 1e-3, of_heavy = in_contact ? bound : 1e-4;
    if (!(off.of_all < bound * off.moved && off.of_heavy < of_heavy * off.moved)) {
      const std::string by = std::to_string(off.of_all / off.moved) + ", of heavy nodes by " +
                             std::to_string(off.of_heavy / off.moved);
      bench.SkipWithError(("the GPU's velocities are not the CPU's, by " + by).c_str());
    }
  }
  constexpr int kSubsteps = 200;
  bool blew_up = false, touch = true;
  double speed = 0;
  const auto advance = [&] {
    tissue.advance(kSubsteps, dt, {tools, {}, anchors});
    const FrameResult result = tissue.finish();
    blew_up = result.blew_up || blew_up;
    touch = true;
    for (std::size_t i = 0; i < tools.size(); ++i) {
      const bool is_probe = scene.tools[i].type == ToolType::kProbe;
      touch = touch && (!is_probe || result.loads[i].mean.force.norm() > 0);
    }
    speed = result.max_speed;
  };
  for (int frame = 0; frame < (rings ? 1 : 15); ++frame) advance();
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : bench) advance();
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
  tissue.pull();
  const double strain = largest_strain(tissue.state());
  if (blew_up) bench.SkipWithError("blew up");
  if (!touch) bench.SkipWithError("a probe touches nothing");
  if (!(strain > 0.1)) bench.SkipWithError("not deformed any more");
  const double updates = static_cast<double>(bench.iterations()) * kSubsteps;
  bench.SetItemsProcessed(static_cast<std::int64_t>(updates * tissue.point_count()));
  bench.counters["us_per_substep"] = took.count() / updates;
  bench.counters["points"] = tissue.point_count();
  bench.counters["strain"] = strain;
  bench.counters["speed"] = speed;
  if (is_cut) {
    const FaceContacts& faces = tissue.state().faces;
    int touching = 0;
    for (const std::int32_t i : faces.active) touching += faces.all[i].touching ? 1 : 0;
    bench.counters["contacts"] = static_cast<double>(faces.active.size());
    bench.counters["touching"] = touching;
    bench.counters["front_cells"] = static_cast<double>(tissue.state().front.cells.size());
  }
  const auto bytes_per_point = [&] {
    return static_cast<double>(tissue.device_bytes()) / tissue.point_count();
  };
  bench.counters["bytes_per_point"] = bytes_per_point();
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  bench.counters["bytes_with_cloud"] = bytes_per_point();
  bench.SetLabel(tissue.plan());
}

/// From the last substep to the bytes of a cloud of all points. A message that is new each time has
/// memory that is new to it, which costs more than what is copied into it.
void read(benchmark::State& bench, const CubeSize& size, bool new_memory) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  CudaMpmTissue tissue(cube(size, Law::kFixedCorotated));
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  for (auto _ : bench) {
    if (new_memory) {
      bench.PauseTiming();
      cloud = {};
      bench.ResumeTiming();
    }
    benchmark::DoNotOptimize(tissue.read_points({}, cloud));
  }
  bench.counters["points"] = tissue.point_count();
  bench.SetBytesProcessed(static_cast<std::int64_t>(bench.iterations() * cloud.size()));
}

void add(const std::string& name, const CubeSize& size, Law law, Extra extra) {
  benchmark::RegisterBenchmark((name + std::to_string(size.points)).c_str(), run, size, law, extra)
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using namespace tissue_sim;
  for (const CubeSize& size : kSizes) {
    add("mpm/cuda/", size, Law::kFixedCorotated, Extra::kNone);
    add("mpm/cuda/neo_hookean/", size, Law::kNeoHookean, Extra::kNone);
    add("mpm/cuda/ellipsoid/", size, Law::kFixedCorotated, Extra::kOrgan);
    add("mpm/cuda/cut_ellipsoid/", size, Law::kFixedCorotated, Extra::kCutOrgan);
    add("mpm/cuda/cut/", size, Law::kFixedCorotated, Extra::kCut);
    add("mpm/cuda/partial_cut/", size, Law::kFixedCorotated, Extra::kPartialCut);
    add("mpm/cuda/front/", size, Law::kFixedCorotated, Extra::kFront);
    add("mpm/cuda/contact/", size, Law::kFixedCorotated, Extra::kContact);
    add("mpm/cuda/tools/", size, Law::kFixedCorotated, Extra::kTools);
    add("mpm/cuda/all_options/", size, Law::kFixedCorotated, Extra::kAll);
    add("mpm/cuda/anchors/", size, Law::kFixedCorotated, Extra::kAnchors);
    add("mpm/cuda/anchors/balls/", size, Law::kFixedCorotated, Extra::kBalls);
    add("mpm/cuda/ringing/", size, Law::kFixedCorotated, Extra::kRinging);
    add("mpm/cuda/ringing_contact/", size, Law::kFixedCorotated, Extra::kRingingContact);
  }
  for (const bool new_memory : {false, true}) {
    benchmark::RegisterBenchmark(
        new_memory ? "mpm/cuda/read_points/new/1000000" : "mpm/cuda/read_points/1000000",
        [=](benchmark::State& bench) { read(bench, kSizes[3], new_memory); })
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  add_liver_benchmarks();
  add_mls_cuda_rows();
  add_pbd_cuda_rows();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
