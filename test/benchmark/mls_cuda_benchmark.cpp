// Speed of the meshless method on the GPU: rows as mls_benchmark.cpp has them for the CPU.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <string>

#include "benchmark/mls_benchmark.h"
#include "compute/cuda_check.h"
#include "mls/cuda/cuda_mls_tissue.h"
#include "mls/mls_scenes.h"

namespace tissue_sim {
namespace {

constexpr double kSpacing = 0.0015;
constexpr int kSubsteps = 100;

void run(benchmark::State& bench, int nodes, bool is_cut) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  const double edge = std::round(std::cbrt(nodes)) * kSpacing;
  Scene scene = inviscid(mls_box(Vec3::Constant(edge), kSpacing));
  scene.ground.enabled = true;
  scene.ground.z = -0.1;
  scene.tools.resize(1);
  CudaMlsTissue tissue(scene);
  MlsState& s = tissue.state();
  if (is_cut) tissue.cut_now(plane_cut(Vec3::Constant(0.501 * edge), Vec3(1, 0.6, 0.3)));
  for (int i = 0; i < s.count(); ++i) {
    const Vec3 x = s.nodes.place[i];
    const Vec3 u(0.2 * x.y() + 0.002 * std::sin(60 * x.x()), 0.15 * x.x() - 0.2 * x.y(),
                 0.2 * x.z() + 0.1 * x.x());
    for (int a = 0; a < 3; ++a) s.u[4 * i + a] = static_cast<float>(u[a]);
  }
  tissue.push();
  ToolMotion probe;
  probe.present = true;
  probe.begin.position = probe.end.position = Vec3(0, 0, 1);
  const FrameInput input{{&probe, 1}, {}};
  tissue.begin_frame(1 / scene.frame_rate, input, {scene, input, 1 / scene.frame_rate});
  // So short that the body stays deformed however long the run is.
  const FramePart part{even_substeps(kSubsteps, 1e-8), 0, 1};
  for (auto _ : bench) tissue.run_part(part);
  tissue.pull();
  Array<float> on_gpu(s.u.size()), on_cpu(s.u.size());
  tissue.forces_at(s.u.data(), on_gpu.data(), 1);
  internal_forces(s, s.u.data(), on_cpu.data());
  double most = 0, off = 0;
  for (std::size_t k = 0; k < 4 * static_cast<std::size_t>(s.count()); ++k) {
    most = std::max<double>(most, std::fabs(on_cpu[k]));
    off = std::max<double>(off, std::fabs(on_cpu[k] - on_gpu[k]));
  }
  if (!(off < 1e-4 * most)) bench.SkipWithError("forces are not the CPU's");
  bench.SetItemsProcessed(bench.iterations() * kSubsteps * s.count());
  bench.counters["nodes"] = s.count();
  bench.counters["neighbours"] = static_cast<double>(s.pairs.other.size()) / s.count();
  bench.counters["us_a_substep"] =
      benchmark::Counter(1e-6 * kSubsteps * static_cast<double>(bench.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  bench.SetLabel(tissue.device_name());
}

}  // namespace

void add_mls_cuda_rows() {
  for (const int nodes : {10000, 50000, 1000000}) {
    for (const bool is_cut : {false, true}) {
      benchmark::RegisterBenchmark(
          ("mls/cuda/" + std::to_string(nodes) + (is_cut ? "/cut" : "")).c_str(),
          [nodes, is_cut](benchmark::State& s) { run(s, nodes, is_cut); })
          ->Unit(benchmark::kMicrosecond)
          ->UseRealTime()
          ->MinTime(0.3);
    }
  }
}

}  // namespace tissue_sim
