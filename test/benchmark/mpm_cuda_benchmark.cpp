// The material point method on the GPU: a cube between two anchored faces that its weight shears,
// to compare with others; organs as users run them (organ_benchmark.h).
#include <benchmark/benchmark.h>

#include <Eigen/SVD>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include "benchmark/camera_benchmark.h"
#include "benchmark/fluid_benchmark.h"
#include "benchmark/mls_benchmark.h"
#include "benchmark/organ_benchmark.h"
#include "benchmark/pbd_benchmark.h"
#include "compute/cuda_check.h"
#include "math/bspline.h"
#include "mpm/mpm_tissue.h"
#include "support/cuda_mpm_tissue.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

struct CubeSize {
  int points;   // as the benchmark is called
  int x, y, z;  // cells
};
constexpr CubeSize kSizes[] = {{25000, 15, 15, 14},
                               {100000, 23, 23, 24},
                               {1000000, 50, 50, 50},
                               {4100000, 80, 80, 80},
                               {16800000, 128, 128, 128}};

constexpr double kShear = 0.5, kFace = 0.0011;  // the lower face's place [m]
/// How far above the lower face the upper one is [m].
double face_above(const CubeSize& size) { return 0.001 * size.z - 2 * kFace; }

Scene cube(const CubeSize& size) {
  Scene scene;
  scene.damping = 50;
  scene.cell_size = 0.001;
  scene.ground.z = -1;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.size = 0.001 * Vec3(size.x, size.y, size.z);
  body.pose.position = 0.5 * body.size;
  Region below, above;
  below.z = kFace;
  above.kind = Region::Kind::kBox;
  above.min = Vec3(-1, -1, body.size[2] - kFace);
  above.max = Vec3(1, 1, 1);
  body.anchors = {below, above};
  scene.materials.resize(1);
  scene.materials[0].name = "test";
  body.material = "test";
  // Sideways, so much that it shears by kShear at its faces.
  const Material& m = scene.materials[0];
  scene.gravity = Vec3(2 * kShear * lame_mu(m) / (m.density * face_above(size)), 0, 0);
  return scene;
}

/// The parabola of its shear, and waves of some cells' length; nothing at the faces and beyond.
void deform(MpmState& state, const CubeSize& size) {
  const LatticeBody& b = state.bodies[0];
  const double h = b.cell_size, above = face_above(size);
  b.for_each_node([&](int node, int i, int j, int k) {
    const double x = i + 1, y = j + 1, z = k + 1;
    const double share = (b.node_position(i, j, k).z() - kFace) / above;
    const double bulge = std::max(0.0, 4 * share * (1 - share));
    const double u[3] = {bulge * (0.25 * kShear * above + 0.1 * h * std::sin(0.4 * y)),
                         bulge * 0.1 * h * std::sin(0.5 * x + z),
                         bulge * 0.1 * h * std::sin(0.3 * x)};
    for (int a = 0; a < 3; ++a) state.nodes.u[a][node] = static_cast<float>(u[a]);
  });
}

/// Largest ||F - R||, from the clouds' von Mises stress being no measure of it: on the host.
double largest_strain(const MpmState& s) {
  double largest = 0;
  const LatticeBody& b = s.bodies[0];
  for (int p = 0; p < s.points.size(); p += 1 + s.points.size() / 20000) {
    const Points::Site& site = s.points.site[p];
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 27; ++k) {
      const int n = s.fields->node(b, site, k);
      const int i[3] = {k % 3, k / 3 % 3, k / 9}, t[3] = {site.x & 1, site.y & 1, site.z & 1};
      for (int a = 0; a < 3; ++a) {
        double w = 1 / b.cell_size;
        for (int c = 0; c < 3; ++c) {
          w *= c == a ? lattice_slope(t[c], i[c]) : lattice_weight(t[c], i[c]);
        }
        for (int c = 0; c < 3; ++c) F(c, a) += w * s.nodes.u[c][n];
      }
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    largest = std::max(largest, (F - svd.matrixU() * svd.matrixV().transpose()).norm());
  }
  return largest;
}

/// By how much velocities of nodes differ, of the largest. `b` may have more nodes, for it numbers
/// all of its box.
double difference(const MpmState& a, const MpmState& b) {
  double off = 0, moved = 0;
  a.bodies[0].for_each_node([&](int i, int x, int y, int z) {
    const int j = b.bodies[0].node(x, y, z);
    for (int c = 0; c < 3; ++c) {
      if (a.nodes.inv_mass[i] == 0) continue;
      off = std::max<double>(off, std::fabs(a.nodes.v[c][i] - b.nodes.v[c][j]));
      moved = std::max<double>(moved, std::fabs(a.nodes.v[c][i]));
    }
  });
  return off / moved;
}

/// Frames of 200 substeps, once drag has brought it to rest.
void run_cube(benchmark::State& bench, const CubeSize& size) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  const Scene scene = cube(size);
  CudaMpmTissue tissue(scene);
  deform(tissue.state(), size);
  tissue.push();
  const float dt = 0.5f * tissue.stable_substep();
  if (size.points <= 1000000) {  // against the CPU, ten substeps on
    MpmTissue cpu(scene);
    deform(cpu.state(), size);
    measure_motion(cpu.state());
    advance_by(cpu, 10, dt, {});
    cpu.finish();
    advance_by(tissue, 10, dt, {});
    tissue.finish();
    tissue.pull();
    const double off = difference(cpu.state(), tissue.state());
    bench.counters["v_error"] = off;
    if (!(off < 1e-4)) bench.SkipWithError("the GPU's velocities are not the CPU's");
  }
  constexpr int kSubsteps = 200;
  bool blew_up = false;
  const auto advance = [&] {
    advance_by(tissue, kSubsteps, dt, {});
    blew_up = tissue.finish().blew_up || blew_up;
  };
  for (int frame = 0; frame < 15; ++frame) advance();
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : bench) advance();
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
  tissue.pull();
  const double strain = largest_strain(tissue.state());
  if (blew_up) bench.SkipWithError("blew up");
  if (!(strain > 0.1)) bench.SkipWithError("not deformed any more");
  const double updates = static_cast<double>(bench.iterations()) * kSubsteps;
  bench.SetItemsProcessed(static_cast<std::int64_t>(updates * tissue.point_count()));
  bench.counters["us_per_substep"] = took.count() / updates;
  bench.counters["points"] = tissue.point_count();
  bench.counters["strain"] = strain;
  bench.counters["bytes_per_point"] =
      static_cast<double>(tissue.device_bytes()) / tissue.point_count();
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
  CudaMpmTissue tissue(cube(size));
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

std::string plan_of(const Tissue& tissue) {
  return plan(on_gpu(dynamic_cast<const MpmTissue&>(tissue)));
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using namespace tissue_sim;
  const auto add = [](const std::string& name, const auto& run) {
    benchmark::RegisterBenchmark(("mpm/cuda/" + name).c_str(), run)
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  };
  for (const CubeSize& size : kSizes) {
    add("cube/" + std::to_string(size.points),
        [size](benchmark::State& bench) { run_cube(bench, size); });
  }
  for (const bool new_memory : {false, true}) {
    add(new_memory ? "read_points/new/1000000" : "read_points/1000000",
        [new_memory](benchmark::State& bench) { read(bench, kSizes[2], new_memory); });
  }
  add_organ_benchmarks(Device::kCuda, plan_of);
  add_camera_benchmarks(Device::kCuda);
  add_mls_cuda_rows();
  add_pbd_cuda_rows();
  add_fluid_cuda_rows();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
