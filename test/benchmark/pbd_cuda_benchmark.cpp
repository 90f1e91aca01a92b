// Speed of position-based dynamics on the GPU: rows as pbd_benchmark.cpp has them for the CPU, and
// whole frames of a small body.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <string>

#include "benchmark/pbd_benchmark.h"
#include "benchmark/pbd_bodies.h"
#include "compute/cuda_check.h"
#include "pbd/cuda/cuda_pbd_tissue.h"

namespace tissue_sim {
namespace {

using Way = CudaPbdTissue::Way;

bool is_finite(const pbd::State& s) {
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (!s.vertices.position(i).allFinite()) return false;
  }
  return true;
}

int constraints(const pbd::State& s) {
  return s.links.size() + s.bends.size() + s.strains.size() + s.elastics.size();
}

void project(benchmark::State& bench, CudaPbdTissue& tissue) {
  constexpr int kTimes = 10;
  tissue.push_all();
  for (auto _ : bench) {
    tissue.project(1e-3f, kTimes);
    tissue.wait();
  }
  const pbd::State& s = tissue.state();
  if (!is_finite(s)) return bench.SkipWithError("not finite");
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) * kTimes * constraints(s));
  bench.counters["constraints"] = constraints(s);
  bench.counters["vertices"] = s.vertices.size();
  bench.counters["colours"] =
      static_cast<double>(s.links.begin.size() + s.bends.begin.size() + s.strains.begin.size() +
                          s.elastics.begin.size()) -
      4;
}

void links(benchmark::State& bench, int n) {
  CudaPbdTissue tissue(tetrahedra_alone(PbdElasticity::kMaterial, 0.01));
  pbd::State& s = tissue.state();
  s.elastics.remove_if([](int) { return true; });
  s.vertices = {};
  s.triangles.clear();
  s.tetrahedra.clear();
  add_links_of_lattice(s, n);
  project(bench, tissue);
}

void tetrahedra(benchmark::State& bench, PbdElasticity elasticity, double edge) {
  CudaPbdTissue tissue(tetrahedra_alone(elasticity, edge));
  disturb(tissue.state());
  project(bench, tissue);
}

/// A body of about as many vertices as the bunny of the 2022 paper has, on the ground, ten steps a
/// frame.
void frame(benchmark::State& bench, PbdModel model, Way way, bool with_figures, int steps = 10,
           double bending = 1) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.pbd.model = model;
  scene.pbd.steps = steps;
  scene.pbd.bending = bending;
  scene.cell_size = model == PbdModel::kSurface ? 0.0053 : 0.012;
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kEllipsoid;
  scene.bodies[0].radii = Vec3(0.1, 0.08, 0.07);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.071);
  scene.tools.resize(1);
  CudaPbdTissue tissue(scene);
  tissue.set_way(way);
  ToolMotion probe;
  probe.present = true;
  probe.begin.position = probe.end.position = Vec3(0, 0, 1);
  const FrameInput input{{&probe, 1}, {}};
  FrameResult result;
  for (auto _ : bench) {
    tissue.advance(1 / scene.frame_rate, input);
    if (with_figures) result = tissue.finish();
  }
  const pbd::State& s = tissue.state();
  if (!is_finite(s) || result.blew_up) return bench.SkipWithError("not finite");
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) * scene.pbd.steps *
                          constraints(s));
  bench.counters["constraints"] = constraints(s);
  bench.counters["vertices"] = s.vertices.size();
  constexpr const char* kNames[] = {"", "launches", "one block"};
  bench.SetLabel(kNames[static_cast<int>(tissue.way())]);
}

template <class Run>
void add(const std::string& name, const Run& run) {
  benchmark::RegisterBenchmark(("pbd/cuda/" + name).c_str(),
                               [run](benchmark::State& bench) {
                                 const std::string why = why_no_gpu();
                                 if (!why.empty()) return bench.SkipWithError(why.c_str());
                                 run(bench);
                               })
      ->Unit(benchmark::kMicrosecond)
      ->UseRealTime()
      ->MinTime(0.3);
}

}  // namespace

void add_pbd_cuda_rows() {
  using State = benchmark::State;
  add("distance/400000", [](State& s) { links(s, 39); });
  add("distance/2000000", [](State& s) { links(s, 66); });
  add("strain", [](State& s) { tetrahedra(s, PbdElasticity::kStrain, 0.0025); });
  add("elastic", [](State& s) { tetrahedra(s, PbdElasticity::kMaterial, 0.0025); });
  for (const bool is_surface : {true, false}) {
    const PbdModel model = is_surface ? PbdModel::kSurface : PbdModel::kTetrahedra;
    const std::string name = is_surface ? "bunny" : "bunny_tetrahedra";
    add(name, [=](State& s) { frame(s, model, Way::kFaster, false); });
    add(name + "/figures", [=](State& s) { frame(s, model, Way::kFaster, true); });
    add(name + "/one_block", [=](State& s) { frame(s, model, Way::kOneBlock, false); });
    add(name + "/launches", [=](State& s) { frame(s, model, Way::kLaunches, false); });
    // What a frame takes besides its steps, and of them what the links take.
    add(name + "/steps:1", [=](State& s) { frame(s, model, Way::kFaster, false, 1); });
    if (is_surface) {
      add(name + "/no_bending", [=](State& s) { frame(s, model, Way::kFaster, false, 10, 0); });
    }
  }
}

}  // namespace tissue_sim
